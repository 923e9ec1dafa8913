//! Meshes meant to hurt: every way in which input is known to have broken a structure.
//!
//! [`meshes`] lists them. None is an error: a structure builds over each, leaves out triangles with vertices that are not finite, and
//! answers for all others as if they were alone.

use crate::numbers::{Random, mesh, pow2};
use crate::soup::{self, Soup};
use crate::trial::{Trial, map};
use rt_geom::glam::DVec3;
use rt_shapes::TriangleMesh;

/// Each hostile mesh with its name, of at most 2000 triangles.
///
/// ```
/// let meshes = rt_scenes::hostile::meshes();
/// assert!(meshes.iter().any(|trial| trial.name == "empty" && trial.mesh.triangles().is_empty()));
/// ```
pub fn meshes() -> Vec<Trial> {
    let nan = f32::NAN;
    let inf = f32::INFINITY;
    let [p, q, r] = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    let mut all = vec![
        Trial::new("empty", mesh(Vec::new(), Vec::new())),
        Trial::new("vertices without triangles", mesh(vec![p, q, r, [nan; 3]], Vec::new())),
        Trial::new("one triangle", mesh(vec![p, q, r], vec![[0, 1, 2]])),
        Trial::new(
            "two triangles of one square",
            mesh(vec![p, q, r, [1.0, 1.0, 1.0]], vec![[0, 1, 2], [1, 3, 2]]),
        ),
        Trial::new("300 times one triangle", mesh(vec![p, q, r], vec![[0, 1, 2]; 300])),
        Trial::new("150 pairs, back to back", mesh(vec![p, q, r], [[0, 1, 2], [0, 2, 1]].repeat(150))),
        Trial::new("300 equal centroids", concentric(300)),
        Trial::new("300 collinear centroids", row(300, DVec3::X)),
        Trial::new("300 centroids on a diagonal", row(300, DVec3::new(1.0, -1.0, 0.5))),
        Trial::new("flat in x", flat(0, 0.0)),
        Trial::new("flat in y, at 1e6", flat(1, 1e6)),
        Trial::new("flat in z, at -0", flat(2, -0.0)),
        Trial::new("two equal boxes among many", twins()),
        Trial::new("stack of 400 parallel squares", stack(400)),
        Trial::new("coordinates of 1e30", map(&soup::uniform(60, 31), |p| p * 1e30)),
        Trial::new(
            "up to the greatest float",
            map(&soup::uniform(60, 32), |p| p.clamp(DVec3::NEG_ONE, DVec3::ONE) * f64::from(f32::MAX)),
        ),
        Trial::new("coordinates of 1e-30", map(&soup::uniform(60, 33), |p| p * 1e-30)),
        Trial::new("subnormal coordinates", map(&soup::uniform(60, 34), |p| p * 1e-42)),
        Trial::new("one unit from the least float", map(&soup::cube(), |p| p * f64::from(f32::from_bits(1)))),
        Trial::new("coordinates 2^i, i from -126 to 126", progression(-126, 126)),
        Trial::new("coordinates 3^-i about a corner", thirds(75)),
        Trial::new("boxes nested from 2^-60 to 2^60", nested(-60, 60)),
        Trial::new("huge triangle over a small soup", mixed_sizes()),
        Trial::new("a few units in the last place at 1e7", last_places()),
        Trial::new("no triangle has area", degenerate(200, false)),
        Trial::new("every other triangle has no area", degenerate(200, true)),
        Trial::new("one point, 300 times", mesh(vec![[3.0, -2.0, 1.0]], vec![[0; 3]; 300])),
        Trial::new("300 points", points(300)),
        Trial::new("only NaN", mesh(vec![[nan; 3]; 3], vec![[0, 1, 2]; 40])),
        Trial::new("only infinities", mesh(vec![[inf; 3], [-inf; 3], [inf, 0.0, -inf]], vec![[0, 1, 2]; 40])),
        Trial::new("needles to aspect 1e12", needles()),
        Trial::new("thousands of tiny triangles beside one of size 1", beside()),
    ];
    for (name, bad) in [
        ("NaN", [nan; 3]),
        ("one NaN component", [0.0, nan, 0.0]),
        ("infinite", [inf; 3]),
        ("one infinite component", [0.0, 0.0, -inf]),
    ] {
        all.push(Trial::new(format!("soup with {name} among its vertices"), spoiled(bad)));
    }
    all
}

/// The square in a plane across `axis`, about `middle`.
fn square(soup: &mut Soup, axis: usize, middle: DVec3, half: f64) {
    let (mut u, mut v) = (DVec3::ZERO, DVec3::ZERO);
    u[(axis + 1) % 3] = half;
    v[(axis + 2) % 3] = half;
    let [a, b, c, d] = [middle - u - v, middle + u - v, middle + u + v, middle - u + v];
    soup.push([a, b, c]);
    soup.push([a, c, d]);
}

/// Triangles of all sizes from 1 to `n` about the same centroid, whose boxes have the same middle.
fn concentric(n: u32) -> TriangleMesh {
    let mut soup = Soup::new(n);
    for i in 1..=n {
        let s = f64::from(i) / 64.0;
        let side = if i % 2 == 0 { s } else { -s };
        soup.push([DVec3::new(-s, -s, side), DVec3::new(s, -s, 0.0), DVec3::new(0.0, s, -side)]);
    }
    soup.mesh()
}

fn row(n: u32, step: DVec3) -> TriangleMesh {
    let mut soup = Soup::new(n);
    for i in 0..n {
        let at = step * f64::from(i);
        soup.push([
            at + DVec3::new(0.0, -0.5, -0.5),
            at + DVec3::new(0.0, 0.5, -0.5),
            at + DVec3::new(0.0, 0.0, 1.0),
        ]);
    }
    soup.mesh()
}

/// A soup pressed into the plane across `axis` at `height`.
fn flat(axis: usize, height: f64) -> TriangleMesh {
    map(&soup::uniform(200, 35), |mut p| {
        p[axis] = height;
        p
    })
}

/// Pairs of triangles with one box that are not the same triangle.
fn twins() -> TriangleMesh {
    let mut soup = Soup::new(200);
    for i in 0..100 {
        let at = DVec3::new(f64::from(i % 10), f64::from(i / 10), 0.0);
        let [a, b, c, d] = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 1.0), DVec3::new(0.0, 1.0, 1.0)];
        soup.push([a, b, c].map(|p| at + p));
        soup.push([a, c, d].map(|p| at + p));
    }
    soup.mesh()
}

fn stack(n: u32) -> TriangleMesh {
    let mut soup = Soup::new(2 * n);
    (0..n).for_each(|i| square(&mut soup, 2, DVec3::new(0.0, 0.0, f64::from(i)), 1.0));
    soup.mesh()
}

/// Triangles at `2^i`, as large as they are far: whoever halves space in the middle parts one from the rest at each level.
fn progression(from: i32, to: i32) -> TriangleMesh {
    let mut soup = Soup::new((to - from + 1).unsigned_abs());
    for i in from..=to {
        let s = pow2(i);
        soup.push([DVec3::new(s, 0.0, 0.0), DVec3::new(s, s, 0.0), DVec3::new(s, 0.0, s)]);
    }
    soup.mesh()
}

/// Squares of side `3^-i`, as far from zero as they are large.
fn thirds(n: u32) -> TriangleMesh {
    let mut soup = Soup::new(2 * n);
    let mut size = 1.0;
    for i in 0..n {
        square(&mut soup, (i % 3) as usize, DVec3::splat(size * 1.5), size * 0.5);
        size /= 3.0;
    }
    soup.mesh()
}

/// Cubes about zero, of sides `2^from` to `2^to`.
fn nested(from: i32, to: i32) -> TriangleMesh {
    let cube = soup::cube();
    let mut soup = Soup::new(12 * (to - from + 1).unsigned_abs());
    for i in from..=to {
        for prim in 0..12 {
            soup.push(cube.triangle(prim).corners.map(|p| p * pow2(i)));
        }
    }
    soup.mesh()
}

fn mixed_sizes() -> TriangleMesh {
    let small = soup::uniform(200, 36);
    let mut soup = Soup::new(201);
    (0..200).for_each(|prim| soup.push(small.triangle(prim).corners));
    soup.push([DVec3::new(-1e18, -1e18, -2.0), DVec3::new(1e18, -1e18, -2.0), DVec3::new(0.0, 1e18, 2.0)]);
    soup.mesh()
}

fn last_places() -> TriangleMesh {
    // At 1e7 floats are whole numbers.
    map(&soup::uniform(200, 37), |p| DVec3::splat(1e7) + (p * 8.0).round())
}

/// Triangles without area, of each kind; or with others between.
fn degenerate(n: u32, every_other: bool) -> TriangleMesh {
    let good = soup::uniform(n, 38);
    let mut soup = Soup::new(n);
    for prim in 0..n {
        let [a, b, c] = good.triangle(prim).corners;
        soup.push(match prim % 6 {
            1 | 3 | 5 if every_other => [a, b, c],
            0 => [a, a, a],
            1 => [a, a, b],
            2 => [a, b, a],
            3 => [a, b, b],
            // Halves and doubles are exact: these three are in line.
            4 => [DVec3::ZERO, a, a * 2.0],
            _ => [a, a * 0.5, a * 4.0],
        });
    }
    soup.mesh()
}

fn points(n: u32) -> TriangleMesh {
    let soup = soup::uniform(n, 39);
    mesh(soup.vertices().to_vec(), (0..n).map(|i| [3 * i; 3]).collect())
}

/// Diagonal needles of length 1 and width `10^-i`, where the last widths are below what coordinates near 1 can tell.
fn needles() -> TriangleMesh {
    let mut soup = Soup::new(130);
    let mut width = 1.0;
    for i in 0..130u32 {
        if i % 10 == 0 {
            width *= 0.1;
        }
        let at = DVec3::new(f64::from(i % 10) * 0.1, 0.0, 0.0);
        // One end at zero, where small numbers are told apart.
        soup.push([at, at + DVec3::ONE, DVec3::new(at.x, width, -width)]);
    }
    soup.mesh()
}

fn beside() -> TriangleMesh {
    let mut random = Random::new(40);
    let mut soup = Soup::new(1500);
    square(&mut soup, 2, DVec3::ZERO, 1.0);
    let mut point = || DVec3::new(random.signed(), random.signed(), random.signed());
    for _ in 2..1500 {
        let at = DVec3::new(3.0, 0.0, 0.0) + point() * 1e-4;
        soup.push([0; 3].map(|_| at + point() * 1e-6));
    }
    soup.mesh()
}

/// A soup in which every seventh vertex is `bad`.
fn spoiled(bad: [f32; 3]) -> TriangleMesh {
    let good = soup::uniform(140, 41);
    let spoil = |(i, &v): (usize, &[f32; 3])| if i % 7 == 3 { bad } else { v };
    mesh(good.vertices().iter().enumerate().map(spoil).collect(), good.triangles().to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_accel::Bounded;

    #[test]
    fn they_are_what_they_are_called() {
        let all = meshes();
        let find = |name: &str| &all.iter().find(|trial| trial.name == name).unwrap().mesh;
        assert_eq!(find("no triangle has area").degenerate(), 200);
        assert_eq!(find("every other triangle has no area").degenerate(), 100);
        assert_eq!(find("300 points").degenerate(), 300);
        let valid = |mesh: &TriangleMesh| {
            (0..mesh.prim_count() as u32).filter(|&prim| mesh.bound(prim).is_valid()).count()
        };
        assert_eq!((valid(find("only NaN")), valid(find("only infinities"))), (0, 0));
        assert_eq!(valid(find("soup with one NaN component among its vertices")), 80);
        let centers = find("300 equal centroids");
        assert!((0..300).all(|prim| centers.bound(prim).center() == centers.bound(0).center()));
        assert!(find("subnormal coordinates").vertices().iter().flatten().all(|x| !x.is_normal()));
        let greatest =
            find("up to the greatest float").vertices().iter().flatten().fold(0.0f32, |m, x| m.max(*x));
        assert!(greatest > 3e38 && greatest.is_finite());
        assert!(all.iter().all(|trial| trial.mesh.prim_count() <= 2000));
    }
}
