//! Bounding spheres and oriented boxes, judged by integers of any length.

mod containment;
mod points;
mod quality;
mod rays;
