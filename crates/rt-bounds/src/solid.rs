//! [`Solid`]: what half-spaces leave of a box, for its area.

use rt_geom::glam::DVec3;

/// A convex solid as the polygons of its faces, in `f64`: good for areas, not for decisions.
///
/// It may be flat or a point. Faces share no corners by name, so that a cut never has to mend a structure: it shortens each
/// polygon on its own, and the new face is what the cuts left open.
#[derive(Clone, Debug)]
pub(crate) struct Solid {
    faces: Vec<Face>,
    /// What counts as on a plane: some roundings of the largest coordinate.
    tolerance: f64,
}

/// A polygon, its area times its normal, and its area.
#[derive(Clone, Debug)]
struct Face {
    corners: Vec<DVec3>,
    vector: DVec3,
    area: f64,
}

impl Face {
    fn new(corners: Vec<DVec3>) -> Face {
        let vector = area_vector(&corners);
        Face { corners, vector, area: vector.length() }
    }
}

impl Solid {
    /// The box between two finite corners, `min <= max`.
    pub(crate) fn cuboid(min: DVec3, max: DVec3) -> Solid {
        let corner = |i: usize| {
            DVec3::new(
                if i & 1 == 0 { min.x } else { max.x },
                if i & 2 == 0 { min.y } else { max.y },
                if i & 4 == 0 { min.z } else { max.z },
            )
        };
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let faces = faces.map(|face| Face::new(face.map(corner).to_vec())).to_vec();
        Solid { faces, tolerance: min.abs().max(max.abs()).max_element() * (16.0 * f64::EPSILON) }
    }

    /// The sum of the areas of the faces.
    pub(crate) fn area(&self) -> f64 {
        self.faces.iter().map(|face| face.area).sum()
    }

    /// The area that is left after [`Solid::cut`], without cutting; `n` is a unit vector.
    ///
    /// The area vectors of a closed surface add up to zero, so the open faces tell the area of the new one.
    pub(crate) fn area_if_cut(&self, n: DVec3, d: f64) -> f64 {
        let (mut area, mut open) = (0.0, DVec3::ZERO);
        for face in &self.faces {
            let (vector, size) = match place(&face.corners, n, d, self.tolerance) {
                Place::Inside => (face.vector, face.area),
                Place::Outside => continue,
                Place::Across => {
                    let vector = area_vector_below(&face.corners, n, d, self.tolerance);
                    (vector, vector.length())
                }
            };
            area += size;
            open += vector;
        }
        area + (-open.dot(n)).max(0.0)
    }

    /// Keeps what satisfies `n . x <= d`, for a unit `n`; whether anything was cut off.
    pub(crate) fn cut(&mut self, n: DVec3, d: f64) -> bool {
        let tolerance = self.tolerance;
        if self.faces.iter().all(|face| matches!(place(&face.corners, n, d, tolerance), Place::Inside)) {
            return false;
        }
        let mut rim = Vec::with_capacity(16);
        self.faces.retain_mut(|face| {
            match place(&face.corners, n, d, tolerance) {
                Place::Inside => {}
                Place::Outside => return false,
                Place::Across => {
                    let mut kept = Vec::with_capacity(face.corners.len() + 1);
                    clip(&face.corners, n, d, tolerance, |p, on_plane| {
                        kept.push(p);
                        if on_plane {
                            rim.push(p);
                        }
                    });
                    *face = Face::new(kept);
                }
            }
            true
        });
        if rim.len() >= 3 {
            self.faces.push(Face::new(around(&rim, n)));
        }
        true
    }
}

enum Place {
    Inside,
    Outside,
    Across,
}

fn place(face: &[DVec3], n: DVec3, d: f64, tolerance: f64) -> Place {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for p in face {
        let s = n.dot(*p) - d;
        (low, high) = (low.min(s), high.max(s));
    }
    match (low > tolerance, high > tolerance) {
        (_, false) => Place::Inside,
        (true, _) => Place::Outside,
        _ => Place::Across,
    }
}

/// The corners of what is left of a polygon, and whether each lies on the plane of the cut.
#[inline]
fn clip(face: &[DVec3], n: DVec3, d: f64, tolerance: f64, mut keep: impl FnMut(DVec3, bool)) {
    let Some(&last) = face.last() else { return };
    let mut from = (last, n.dot(last) - d);
    for &p in face {
        let to = (p, n.dot(p) - d);
        let (inside, was_inside) = (to.1 <= tolerance, from.1 <= tolerance);
        if inside != was_inside {
            // From the inner to the outer end whichever way the face turns: its neighbour finds the same point.
            let (inner, outer) = if inside { (to, from) } else { (from, to) };
            let t = (inner.1 / (inner.1 - outer.1)).clamp(0.0, 1.0);
            keep(inner.0 + (outer.0 - inner.0) * t, true);
        }
        if inside {
            keep(p, to.1 >= -tolerance);
        }
        from = to;
    }
}

/// Half the sum of cross products about the first corner: the area times the normal.
fn area_vector(face: &[DVec3]) -> DVec3 {
    let Some((&first, rest)) = face.split_first() else { return DVec3::ZERO };
    rest.windows(2).map(|w| (w[0] - first).cross(w[1] - first)).sum::<DVec3>() * 0.5
}

fn area_vector_below(face: &[DVec3], n: DVec3, d: f64, tolerance: f64) -> DVec3 {
    let mut sum = DVec3::ZERO;
    let (mut first, mut last) = (None, DVec3::ZERO);
    clip(face, n, d, tolerance, |p, _| {
        let first = *first.get_or_insert(p);
        sum += (last - first).cross(p - first);
        last = p;
    });
    // The first term took `last` from nowhere, but `p - first` was zero then.
    sum * 0.5
}

/// The points of a convex polygon in order around `n`.
fn around(points: &[DVec3], n: DVec3) -> Vec<DVec3> {
    let middle = points.iter().copied().sum::<DVec3>() / points.len() as f64;
    let side = if n.x.abs() < 0.5 { DVec3::X } else { DVec3::Y };
    let u = n.cross(side);
    let v = n.cross(u);
    // Grows with the angle: no need for the angle itself.
    let turn = |p: DVec3| {
        let (x, y) = ((p - middle).dot(u), (p - middle).dot(v));
        let along = x / (x.abs() + y.abs());
        if y < 0.0 { along - 1.0 } else { 1.0 - along }
    };
    let mut sorted: Vec<(f64, DVec3)> = points.iter().map(|p| (turn(*p), *p)).collect();
    sorted.sort_unstable_by(|p, q| p.0.total_cmp(&q.0));
    // Each corner was found by two faces.
    sorted.dedup_by(|p, q| p.1 == q.1);
    sorted.into_iter().map(|(_, p)| p).collect()
}

/// The area of the solid of unit normals and offsets in a box with finite corners; 0 where nothing is left.
pub(crate) fn area(min: DVec3, max: DVec3, planes: impl IntoIterator<Item = (DVec3, f64)>) -> f64 {
    if min.cmpgt(max).any() {
        return 0.0;
    }
    // About the middle and in units of the size, so that squares neither overflow nor underflow.
    let middle = min * 0.5 + max * 0.5;
    let size = (max * 0.5 - min * 0.5).max_element();
    if size == 0.0 {
        return 0.0;
    }
    let unit = |p: DVec3| (p - middle) / size;
    let mut solid = Solid::cuboid(unit(min), unit(max));
    // Offsets are as uncertain as the coordinates they come from.
    solid.tolerance += middle.abs().max_element() / size * (16.0 * f64::EPSILON);
    for (n, d) in planes {
        solid.cut(n, (d - n.dot(middle)) / size);
    }
    solid.area() * size * size
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cube_without_its_corners() {
        let mut solid = Solid::cuboid(DVec3::splat(-1.0), DVec3::ONE);
        assert_eq!(solid.area(), 24.0);
        let n = DVec3::ONE.normalize();
        // Through three neighbours of the corner: three half faces for one equilateral triangle of side 2 sqrt 2.
        let d = n.dot(DVec3::new(1.0, 1.0, -1.0));
        let left = 24.0 - 6.0 + 2.0 * 3f64.sqrt();
        assert!((solid.area_if_cut(n, d) - left).abs() < 1e-12);
        assert!(solid.cut(n, d));
        assert!((solid.area() - left).abs() < 1e-12, "{} {left}", solid.area());
        assert!(!solid.cut(n, d) && !solid.cut(DVec3::X, 1.0));
        solid.cut(DVec3::X, -2.0);
        assert_eq!(solid.area(), 0.0);
    }

    #[test]
    fn flat_ones_have_two_sides() {
        let flat = |planes: &[(DVec3, f64)]| {
            area(DVec3::new(0.0, 0.0, 5.0), DVec3::new(2.0, 2.0, 5.0), planes.iter().copied())
        };
        assert_eq!(flat(&[]), 8.0);
        let n = DVec3::new(1.0, 1.0, 0.0).normalize();
        assert!((flat(&[(n, 2.0 / 2f64.sqrt())]) - 4.0).abs() < 1e-9);
        assert_eq!(area(DVec3::ONE, DVec3::ONE, []), 0.0);
    }
}
