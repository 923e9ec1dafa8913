//! Quadrics against exact arithmetic, finite differences and quadrature.

mod corners;
mod frustum;
mod judge;
mod leave;
mod revolved;
mod seams;
mod surface;
