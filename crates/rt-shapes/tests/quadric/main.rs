//! Quadrics against exact arithmetic, finite differences and quadrature.

// The long tests, run by hand, say what they found.
#![allow(clippy::print_stdout)]

mod corners;
mod frustum;
mod judge;
mod leave;
mod revolved;
mod seams;
mod surface;
