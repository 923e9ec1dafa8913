//! The closest hit, shared by all forms.

use super::form::Form;
use super::solve;
use crate::Uv;
use core::ops::ControlFlow;
use rt_accel::Hit;
use rt_geom::{Ray, Real};

/// The first hit.
#[inline(always)]
pub(super) fn closest<F: Form, R: Real>(form: &F, ray: &Ray<R>) -> Option<Hit<Uv, R>> {
    let mut first = None;
    let _ = solve::hits(form, ray, |t| {
        first = Some(Hit { t, at: Uv::default() });
        ControlFlow::Break(())
    });
    first
}
