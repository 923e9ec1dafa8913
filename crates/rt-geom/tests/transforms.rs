//! Transforms against exact arithmetic: dyadic numbers of any length, which share no code with the library.
//!
//! `RT_CASES=100` asks a hundred times as many.

#![allow(clippy::print_stdout)] // Figures, for `--nocapture`.

use num_bigint::BigInt;
use rt_geom::glam::{DAffine3, DMat3, DQuat, DVec3};
use rt_geom::{Motion, Parts, Ray, Transform, TransformError, angle_between};
use rt_measure::rays::Seeded;
use std::cmp::Ordering;
use std::f64::consts::PI;
use std::ops::{Add, Mul, Neg, Sub};

fn cases(usual: usize) -> usize {
    usual * std::env::var("RT_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(1)
}

/// An integer times a power of two: closed under sums and products.
#[derive(Clone, Debug)]
struct Dyadic(BigInt, i64);

impl Dyadic {
    fn of(x: f64) -> Dyadic {
        assert!(x.is_finite());
        let bits = x.to_bits();
        let (field, low) = ((bits >> 52 & 0x7ff) as i64, (bits & ((1 << 52) - 1)) as i64);
        let (m, e) = if field == 0 { (low, -1074) } else { (low | 1 << 52, field - 1075) };
        Dyadic(BigInt::from(if x < 0.0 { -m } else { m }), e)
    }
    fn abs(self) -> Dyadic {
        if self.0 < BigInt::ZERO { -self } else { self }
    }
    fn aligned(&self, b: &Dyadic) -> (BigInt, BigInt, i64) {
        let e = self.1.min(b.1);
        (&self.0 << (self.1 - e), &b.0 << (b.1 - e), e)
    }
    /// Rounded: for ratios that are printed.
    fn rough(&self) -> f64 {
        let shift = self.0.bits() as i64 - 60;
        let m = if shift > 0 { &self.0 >> shift } else { &self.0 << -shift };
        i64::try_from(m).unwrap() as f64 * 2f64.powi((self.1 + shift).clamp(-1000, 1000) as i32)
    }
}

impl Add for Dyadic {
    type Output = Dyadic;
    fn add(self, b: Dyadic) -> Dyadic {
        let (x, y, e) = self.aligned(&b);
        Dyadic(x + y, e)
    }
}
impl Neg for Dyadic {
    type Output = Dyadic;
    fn neg(self) -> Dyadic {
        Dyadic(-self.0, self.1)
    }
}
impl Sub for Dyadic {
    type Output = Dyadic;
    fn sub(self, b: Dyadic) -> Dyadic {
        self + -b
    }
}
impl Mul for Dyadic {
    type Output = Dyadic;
    fn mul(self, b: Dyadic) -> Dyadic {
        Dyadic(self.0 * b.0, self.1 + b.1)
    }
}
impl PartialEq for Dyadic {
    fn eq(&self, b: &Dyadic) -> bool {
        self.partial_cmp(b) == Some(Ordering::Equal)
    }
}
impl PartialOrd for Dyadic {
    fn partial_cmp(&self, b: &Dyadic) -> Option<Ordering> {
        let (x, y, _) = self.aligned(b);
        x.partial_cmp(&y)
    }
}

/// The exact affine map `p -> L p + b`, or its inverse as a quotient with a common denominator.
struct Exact {
    linear: [[Dyadic; 3]; 3],
    translation: [Dyadic; 3],
}

impl Exact {
    fn of(map: DAffine3) -> Exact {
        let m = map.matrix3.to_cols_array_2d();
        Exact {
            linear: [0, 1, 2].map(|i| [0, 1, 2].map(|j| Dyadic::of(m[j][i]))),
            translation: map.translation.to_array().map(Dyadic::of),
        }
    }
    fn point(&self, p: &[Dyadic; 3]) -> [Dyadic; 3] {
        [0, 1, 2].map(|i| {
            (0..3).fold(self.translation[i].clone(), |s, j| s + self.linear[i][j].clone() * p[j].clone())
        })
    }
    /// First `self`, then `next`.
    fn then(&self, next: &Exact) -> Exact {
        let column = |j: usize| [0, 1, 2].map(|i| self.linear[i][j].clone());
        let zero = [0.0; 3].map(Dyadic::of);
        let turned = Exact { linear: next.linear.clone(), translation: zero };
        let columns = [0, 1, 2].map(|j| turned.point(&column(j)));
        Exact {
            linear: [0, 1, 2].map(|i| [0, 1, 2].map(|j| columns[j][i].clone())),
            translation: next.point(&self.translation),
        }
    }
    fn cofactor(&self, i: usize, j: usize) -> Dyadic {
        let at = |i: usize, j: usize| self.linear[(i) % 3][(j) % 3].clone();
        at(i + 1, j + 1) * at(i + 2, j + 2) - at(i + 1, j + 2) * at(i + 2, j + 1)
    }
    fn determinant(&self) -> Dyadic {
        (0..3).fold(Dyadic::of(0.0), |s, j| s + self.linear[0][j].clone() * self.cofactor(0, j))
    }
    /// `determinant * inverse(q)`.
    fn back(&self, q: &[Dyadic; 3]) -> [Dyadic; 3] {
        let v = [0, 1, 2].map(|i| q[i].clone() - self.translation[i].clone());
        [0, 1, 2].map(|i| (0..3).fold(Dyadic::of(0.0), |s, j| s + self.cofactor(j, i) * v[j].clone()))
    }
}

fn dyadic(p: DVec3) -> [Dyadic; 3] {
    p.to_array().map(Dyadic::of)
}

/// Plain ones, stretched by up to `1e8` between two turns, sheared, mirrored, of any size, far from zero.
fn any_map(seeded: &mut Seeded) -> Transform {
    loop {
        let turn =
            |s: &mut Seeded| DMat3::from_quat(DQuat::from_axis_angle(s.direction(), s.between(-PI, PI)));
        let stretch = |s: &mut Seeded| {
            let factor = [1.0, 10.0, 1e8][s.below(3)];
            let sign = if s.below(2) == 0 { 1.0 } else { -1.0 };
            DMat3::from_diagonal(DVec3::new(factor, sign, 1.0 / [1.0, factor][s.below(2)].sqrt()))
        };
        let linear = match seeded.below(4) {
            0 => DMat3::from_cols_array(&[0; 9].map(|_| seeded.between(-1.0, 1.0))),
            1 => stretch(seeded) * turn(seeded),
            2 => turn(seeded) * stretch(seeded) * turn(seeded),
            _ => {
                let mut shear = DMat3::IDENTITY;
                shear.y_axis.x = [3.0, 1e8][seeded.below(2)];
                shear.z_axis.y = seeded.between(-9.0, 9.0);
                shear * turn(seeded)
            }
        };
        let size = 10f64.powf(seeded.between(-6.0, 6.0));
        let translation = seeded.direction() * 10f64.powf(seeded.between(-6.0, 8.0));
        if let Ok(map) = Transform::new(DAffine3 { matrix3: linear * size, translation }) {
            return map;
        }
    }
}

fn any_point(seeded: &mut Seeded) -> DVec3 {
    seeded.direction() * 10f64.powf(seeded.between(-6.0, 6.0))
}

#[test]
fn points_and_their_bounds_hold_both_ways() {
    let mut seeded = Seeded::new(11);
    let (mut worst, mut worst_back, mut refined) = (0.0f64, 0.0f64, 0.0f64);
    for _ in 0..cases(4000) {
        let map = any_map(&mut seeded);
        let exact = Exact::of(map.affine());
        let p = any_point(&mut seeded);
        // The point itself known within an error, and the true point at the corner of it.
        let error = any_point(&mut seeded).abs() * 1e-9 * seeded.below(2) as f64;
        let truth = [0, 1, 2]
            .map(|i| Dyadic::of(p[i]) + Dyadic::of(if seeded.below(2) == 0 { error[i] } else { -error[i] }));
        let (q, bound) = map.point_with_error(p, error);
        assert_eq!(q, map.point(p));
        let there = exact.point(&truth);
        for i in 0..3 {
            let off = (Dyadic::of(q[i]) - there[i].clone()).abs();
            assert!(off <= Dyadic::of(bound[i]), "{map:?} {p} {error}");
            worst = worst.max(off.rough() / bound[i]);
        }
        // Back: a point of the world near what the map reaches, where p - b cancels.
        let (r, bound) = map.inverse().point_with_error(q, error);
        let truth = [0, 1, 2]
            .map(|i| Dyadic::of(q[i]) + Dyadic::of(if seeded.below(2) == 0 { error[i] } else { -error[i] }));
        let (back, det) = (exact.back(&truth), exact.determinant());
        for i in 0..3 {
            let off = (Dyadic::of(r[i]) * det.clone() - back[i].clone()).abs();
            assert!(off <= Dyadic::of(bound[i]) * det.clone().abs(), "{map:?} {q} {error}");
            worst_back = worst_back.max(off.rough() / (bound[i] * det.rough().abs()));
            if error == DVec3::ZERO {
                refined = refined.max(off.rough() / (bound[i] * det.rough().abs()));
            }
        }
    }
    println!(
        "used of the bound: forward {worst:.3}, back {worst_back:.3}, back without input error {refined:.3}"
    );
    // A bound that is never nearly reached would be no use either.
    assert!(worst > 0.3 && worst_back > 0.3 && refined > 0.2);
}

#[test]
fn inverses_are_right_to_the_last_digit() {
    let mut seeded = Seeded::new(12);
    let one = Dyadic::of(1.0 + 1e-9) * Dyadic::of(f64::EPSILON / 2.0);
    for _ in 0..cases(2000) {
        let map = any_map(&mut seeded);
        let exact = Exact::of(DAffine3::from_mat3(map.linear()));
        let inverse = map.inverse().linear().transpose().to_cols_array_2d();
        let det = exact.determinant();
        assert_eq!(map.swaps_handedness(), det < Dyadic::of(0.0));
        for i in 0..3 {
            for j in 0..3 {
                let cofactor = exact.cofactor(j, i);
                let off = (Dyadic::of(inverse[i][j]) * det.clone() - cofactor.clone()).abs();
                assert!(off <= cofactor.abs() * one.clone(), "{map:?}");
            }
        }
    }
}

#[test]
fn a_hundred_maps_composed_do_not_drift() {
    let mut seeded = Seeded::new(13);
    let (mut own, mut multiplied, mut away) = (0.0f64, 0.0f64, 0.0f64);
    for _ in 0..20 {
        let mut map = Transform::IDENTITY;
        let mut exact = Exact::of(DAffine3::IDENTITY);
        let (mut linear, mut product) = (DMat3::IDENTITY, DMat3::IDENTITY);
        for i in 0..100 {
            let turn = Transform::rotation(seeded.direction(), seeded.between(-PI, PI)).unwrap();
            let s = seeded.between(0.8, 1.25);
            let stretch =
                Transform::scale(DVec3::new(s, 1.0 / s, if i % 7 == 0 { -1.0 } else { 1.0 })).unwrap();
            let step =
                turn.then(&stretch).unwrap().then(&Transform::translation(seeded.direction())).unwrap();
            exact = exact.then(&Exact::of(step.affine()));
            map = map.then(&step).unwrap();
            (linear, product) = (step.linear() * linear, product * step.inverse().linear());
        }
        let off = |a: DMat3, b: DMat3| {
            let d = a * b - DMat3::IDENTITY;
            d.to_cols_array().into_iter().fold(0.0f64, |m, x| m.max(x.abs()))
        };
        let condition = map.condition();
        own = own.max(off(map.linear(), map.inverse().linear()) / condition);
        multiplied = multiplied.max(off(linear, product) / condition);
        // How far the map is from the exact product.
        let size = map.linear().to_cols_array().into_iter().fold(0.0f64, |m, x| m.max(x.abs()));
        for i in 0..3 {
            for j in 0..3 {
                let off = Dyadic::of(map.linear().col(j)[i]) - exact.linear[i][j].clone();
                away = away.max(off.rough().abs() / (size * condition));
            }
        }
    }
    println!(
        "over the condition: |M Minv - I| {own:.1e}; {multiplied:.1e} by stored inverses multiplied; off the exact map {away:.1e}"
    );
    assert!(own <= 4.0 * f64::EPSILON && away <= 100.0 * f64::EPSILON);
}

#[test]
fn ways_back_composed_do_not_cancel() {
    // A small object far from its origin, placed in a group that is placed in the world: back through both.
    let mut seeded = Seeded::new(14);
    let mut worst = 0.0f64;
    for _ in 0..cases(500) {
        let turn = |s: &mut Seeded| Transform::rotation(s.direction(), s.between(-PI, PI)).unwrap();
        let place = |s: &mut Seeded, far: f64| {
            let by = Transform::translation((s.direction() * far * 4096.0).round() / 4096.0);
            turn(s).then(&by).unwrap()
        };
        let (object, group) = (place(&mut seeded, 3.0), place(&mut seeded, 1e6));
        let exact = Exact::of(object.affine()).then(&Exact::of(group.affine()));
        let (down, up) = (group.inverse().then(&object.inverse()).unwrap(), object.then(&group).unwrap());
        let local = seeded.direction() * 1e-3;
        let world = up.point(local);
        let (back, det) = (exact.back(&dyadic(world)), exact.determinant());
        for i in 0..3 {
            let off =
                (Dyadic::of(down.point(world)[i]) * det.clone() - back[i].clone()).rough() / det.rough();
            worst = worst.max(off.abs());
        }
    }
    // The translation in the group's frame, 1e6, is rounded once; nothing else may be as large.
    println!("off by {worst:.1e} at 1e6");
    assert!(worst < 1e6 * 4.0 * f64::EPSILON);
}

#[test]
fn near_singular_maps_are_refused_and_stretched_ones_are_not() {
    let mut seeded = Seeded::new(15);
    for _ in 0..200 {
        let turn =
            |s: &mut Seeded| DMat3::from_quat(DQuat::from_axis_angle(s.direction(), s.between(-PI, PI)));
        let (a, b) = (turn(&mut seeded), turn(&mut seeded));
        let between = |by: f64| DAffine3::from_mat3(a * DMat3::from_diagonal(DVec3::new(by, 1.0, 1.0)) * b);
        let map = Transform::new(between(1e8)).unwrap();
        let p = seeded.direction();
        // Half of the digits are left there and back, and all of the others are right.
        assert!((map.inverse().point(map.point(p)) - p).length() < 1e8 * 8.0 * f64::EPSILON);
        match Transform::new(between(1e15)) {
            Err(TransformError::Singular { condition }) => assert!(condition > 1e12),
            other => panic!("{other:?}"),
        }
        // Along axes of one side a stretch is free: every point keeps its digits along each axis.
        for by in [1e15, 1e200] {
            let axes = DMat3::from_diagonal(DVec3::new(by, 1.0, 1.0));
            let after = Transform::new(DAffine3::from_mat3(axes * b)).unwrap();
            assert!((after.inverse().point(after.point(p)) - p).length() < 8.0 * f64::EPSILON);
            assert!(Transform::new(DAffine3::from_mat3(b * axes)).is_ok());
        }
    }
    let flat = DMat3::from_cols(DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.2, 0.4, 0.6), DVec3::Z);
    let refused = Transform::new(DAffine3::from_mat3(flat));
    assert_eq!(refused, Err(TransformError::Singular { condition: f64::INFINITY }));
    assert!(refused.unwrap_err().to_string().contains("1e12"));
}

#[test]
fn directions_turn_to_directions() {
    let mut seeded = Seeded::new(16);
    for case in 0..cases(20_000) {
        let from = seeded.direction();
        let aside = seeded.direction() * 10f64.powf(-seeded.between(0.0, 20.0));
        let to = [seeded.direction(), from, -from, from + aside, -from + aside][case % 5];
        let size = 10f64.powf(seeded.between(-300.0, 300.0));
        let turn = Transform::rotation_between(from * size, to).unwrap();
        let to = to.normalize();
        assert!((turn.vector(from.normalize()) - to).length() < 8.0 * f64::EPSILON, "{from} {to}");
        let straight = turn.linear() * turn.linear().transpose() - DMat3::IDENTITY;
        assert!(straight.to_cols_array().iter().all(|x| x.abs() < 16.0 * f64::EPSILON));
        assert!(!turn.swaps_handedness());
        // The least rotation leaves alone what is across both.
        let axis = from.cross(to);
        if axis.length() > 1e-3 {
            let axis = axis.normalize();
            assert!((turn.vector(axis) - axis).length() < 1e-11);
        }
    }
    assert!(Transform::rotation_between(DVec3::ZERO, DVec3::X).is_err());
    let quarter = Transform::rotation(DVec3::Z * 1e-200, PI / 2.0).unwrap().point(DVec3::X);
    assert!((quarter - DVec3::Y).length() < f64::EPSILON);
}

#[test]
fn looking_at() {
    let mut seeded = Seeded::new(17);
    for _ in 0..cases(2000) {
        let (eye, target) = (any_point(&mut seeded), any_point(&mut seeded));
        let up = seeded.direction();
        let (Ok(object), Ok(camera)) =
            (Transform::look_at_object(eye, target, up), Transform::look_at_camera(eye, target, up))
        else {
            panic!("{eye} {target} {up}");
        };
        assert!(!object.swaps_handedness() && !camera.swaps_handedness());
        assert_eq!(object.point(DVec3::ZERO), eye);
        assert_eq!(camera.point(eye), DVec3::ZERO);
        let (ahead, distance) = ((target - eye).normalize(), (target - eye).length());
        assert!((object.vector(DVec3::Z) - ahead).length() < 1e-14);
        assert!((camera.point(target) + DVec3::Z * distance).length() < 1e-14 * distance);
        // Up stays up, upright on both pictures.
        assert!(
            object.vector(DVec3::Y).dot(up) > 0.0
                && camera.vector(up).y > 0.0
                && camera.vector(up).x.abs() < 1e-12
        );
    }
    for up in [DVec3::X, -DVec3::X * 3.0, DVec3::ZERO, DVec3::NAN] {
        let error = Transform::look_at_object(DVec3::ZERO, DVec3::X * 0.1, up).unwrap_err();
        assert!(matches!(error, TransformError::NoDirection { of } if of.starts_with("up")), "{up}");
        assert!(Transform::look_at_camera(DVec3::ZERO, DVec3::X * 0.1, up).is_err());
    }
    assert!(Transform::look_at_object(DVec3::ONE, DVec3::ONE, DVec3::X).is_err());
}

#[test]
fn planes_normals_and_rays_go_along() {
    let mut seeded = Seeded::new(18);
    for _ in 0..cases(2000) {
        let map = any_map(&mut seeded);
        let map = if seeded.below(2) == 0 { map } else { map.inverse() };
        let (n, p, v) = (seeded.direction(), seeded.direction(), seeded.direction());
        let (m, d) = map.plane(n, n.dot(p));
        // Everything within the roundings of the terms of the sum.
        let q = map.point(p);
        let terms = m.abs().dot(
            q.abs()
                + map.affine().translation.abs()
                + map.linear().abs() * (p.abs() + (map.inverse().affine().translation).abs()),
        );
        assert!((m.dot(q) - d).abs() <= 64.0 * f64::EPSILON * (terms + 1.0), "{map:?}");
        let terms = (map.inverse().linear().abs().transpose() * n.abs()).dot(map.linear().abs() * v.abs());
        assert!((map.normal(n).dot(map.vector(v)) - n.dot(v)).abs() <= 16.0 * f64::EPSILON * terms);
        let ray = map.ray(&Ray::new(p, v).between(0.5, 2.0));
        assert_eq!((ray.origin, ray.dir, ray.t_min, ray.t_max), (q, map.vector(v), 0.5, 2.0));
    }
}

#[test]
fn normals_of_a_stretched_sphere_are_gradients() {
    let map = Transform::scale(DVec3::new(1.0, 1.0, 2.0)).unwrap();
    let mut seeded = Seeded::new(19);
    for _ in 0..1000 {
        let n = seeded.direction();
        let p = map.point(n);
        let gradient = DVec3::new(p.x, p.y, p.z / 4.0);
        assert!(map.normal(n).normalize().distance(gradient.normalize()) < 4.0 * f64::EPSILON);
        let mirror = Transform::scale(DVec3::new(-1.0, 1.0, 1.0)).unwrap();
        assert!(mirror.swaps_handedness() && mirror.normal(n).dot(mirror.point(n)) > 0.0);
    }
}

#[test]
fn parts_are_found_again() {
    let mut seeded = Seeded::new(20);
    for _ in 0..cases(2000) {
        let rotation = DQuat::from_axis_angle(seeded.direction(), seeded.between(-PI, PI));
        let basis = DMat3::from_quat(DQuat::from_axis_angle(seeded.direction(), seeded.between(-PI, PI)));
        let mirror = if seeded.below(2) == 0 { 1.0 } else { -1.0 };
        let factors =
            DVec3::new(seeded.between(0.1, 5.0), seeded.between(0.1, 5.0), seeded.between(0.1, 5.0)) * mirror;
        let stretch = basis * DMat3::from_diagonal(factors) * basis.transpose();
        let given = Parts { translation: any_point(&mut seeded), rotation, stretch };
        let found = Parts::of(&given.transform().unwrap());
        assert_eq!(found.translation, given.translation);
        assert!(
            (found.rotation.dot(rotation).abs() - 1.0).abs() < 1e-14
                && found.stretch.abs_diff_eq(stretch, 1e-13)
        );
    }
    // Of any map: symmetric, definite, and the map again.
    for _ in 0..cases(500) {
        let map = any_map(&mut seeded);
        let parts = Parts::of(&map);
        let size = map.linear().to_cols_array().into_iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let again = DMat3::from_quat(parts.rotation) * parts.stretch;
        assert!(again.abs_diff_eq(map.linear(), 32.0 * f64::EPSILON * size), "{map:?}");
        assert_eq!(parts.stretch, parts.stretch.transpose());
    }
    // Near the ends of the range: slow, and still right.
    let map = Transform::scale(DVec3::new(1e-200, -1.0, 1e200)).unwrap();
    assert_eq!(Parts::of(&map).rotation.abs().w.max(Parts::of(&map).rotation.abs().y), 1.0);
}

trait Abs {
    fn abs(self) -> Self;
}
impl Abs for DQuat {
    fn abs(self) -> DQuat {
        DQuat::from_array(self.to_array().map(f64::abs))
    }
}

#[test]
fn motions_turn_the_shorter_way_at_constant_speed() {
    let mut seeded = Seeded::new(21);
    for _ in 0..cases(500) {
        let axis = seeded.direction();
        let start = seeded.between(-9.0, 9.0);
        let angle = [seeded.between(-3.1, 3.1), 1e-9 * seeded.unit(), 1e-300, 0.0][seeded.below(4)];
        let at = |a: f64| Transform::rotation(axis, a).unwrap();
        let motion = Motion::new(at(start), at(start + angle)).unwrap();
        let time = seeded.unit();
        let expected = at(start + angle * time);
        assert!(
            motion.at(time).linear().abs_diff_eq(expected.linear(), 1e-14),
            "{axis} {start} {angle} {time}"
        );
        assert_eq!((motion.at(0.0), motion.at(-1.0), motion.at(f64::NAN)), (at(start), at(start), at(start)));
        assert_eq!((motion.at(1.0), motion.at(2.0)), (at(start + angle), at(start + angle)));
    }
    // Half a turn apart: either way, but a turn at every time.
    let half = Motion::new(Transform::IDENTITY, Transform::rotation(DVec3::Z, PI).unwrap()).unwrap();
    for i in 0..=10 {
        let turned = half.at(i as f64 / 10.0).vector(DVec3::X);
        assert!((angle_between(turned, DVec3::X) - PI * i as f64 / 10.0).abs() < 1e-14);
    }
    let mirror = Transform::scale(DVec3::new(-1.0, 1.0, 1.0)).unwrap();
    assert_eq!(Motion::new(Transform::IDENTITY, mirror), Err(TransformError::Mirrors));
    assert!(Motion::new(mirror, mirror.then(&Transform::translation(DVec3::X)).unwrap()).is_ok());
    let (thin, wide) =
        (Transform::scale(DVec3::splat(1e-9)).unwrap(), Transform::scale(DVec3::splat(1e9)).unwrap());
    assert!(matches!(Motion::new(thin, wide), Err(TransformError::Singular { .. })));
}

#[test]
fn paths_are_where_motions_carry_points() {
    let mut seeded = Seeded::new(22);
    for _ in 0..cases(1000) {
        let (a, b) = (any_map(&mut seeded), any_map(&mut seeded));
        let Ok(motion) = Motion::new(a, b) else { continue };
        let p = any_point(&mut seeded);
        let path = motion.path(p);
        for time in [0.0, 1.0, seeded.unit(), seeded.unit()] {
            let (x, y) = (path.at(time), motion.at(time).point(p));
            assert!((x - y).abs().cmple(path.size * (32.0 * f64::EPSILON)).all(), "{a:?} {b:?} {p} {time}");
        }
    }
}

#[test]
fn thin_motions_are_refused_or_made_but_never_stand_still() {
    let mut seeded = Seeded::new(23);
    let (mut made, mut refused) = (0, 0);
    for _ in 0..cases(3000) {
        let stretch = 10f64.powf(seeded.between(9.5, 12.0));
        let mut turn = || Transform::rotation(seeded.direction(), seeded.between(0.5, 2.5)).unwrap();
        let flat = Transform::scale(DVec3::new(1.0, 1.0 / stretch, 1.0)).unwrap();
        let Ok(start) = turn().then(&flat).and_then(|map| map.then(&turn())) else { continue };
        let Ok(end) = start.then(&turn()) else { continue };
        match Motion::new(start, end) {
            Err(error) => {
                assert!(matches!(error, TransformError::Singular { .. }) && stretch > 2e10, "{error}");
                refused += 1;
            }
            Ok(motion) => {
                let (path, time) = (motion.path(DVec3::X), seeded.between(0.1, 0.9));
                let map = motion.at(time);
                let off = (map.point(DVec3::X) - path.at(time)).abs();
                assert!(off.cmple(path.size * (32.0 * f64::EPSILON)).all(), "{stretch:e} {time}");
                assert!(map != start && map.condition() <= motion.condition(), "{stretch:e}");
                made += 1;
            }
        }
    }
    assert!(made > 100 && refused > 100, "{made} {refused}");
}

#[test]
fn motions_between_numbers_without_end_are_refused() {
    for far in [f64::NAN, f64::INFINITY, f64::MAX] {
        let moved = Transform::translation(DVec3::new(0.0, far, 0.0));
        assert_eq!(Motion::new(Transform::IDENTITY, moved), Err(TransformError::NotFinite));
        assert_eq!(Motion::new(moved.inverse(), Transform::IDENTITY), Err(TransformError::NotFinite));
        if !far.is_finite() {
            assert_eq!(moved.then(&Transform::IDENTITY), Err(TransformError::NotFinite));
            assert_eq!(Transform::IDENTITY.then(&moved), Err(TransformError::NotFinite));
            assert_eq!(Transform::new(moved.affine()), Err(TransformError::NotFinite));
        }
    }
    for size in [1e-306, 1e306] {
        let map = Transform::scale(DVec3::splat(size)).unwrap();
        let turned = map.then(&Transform::rotation(DVec3::ONE, 1.0).unwrap()).unwrap();
        let half = Motion::new(map, turned).unwrap().at(0.5).vector(DVec3::X);
        assert!((half.abs().max_element() / size - 0.9).abs() < 0.1, "{half}");
    }
}

#[test]
fn angles_keep_their_digits_at_both_ends() {
    for angle in [1e-300f64, 1e-17, 1e-8, 0.3, 1.0, 2.0, PI - 1e-3] {
        let b = DVec3::new(angle.cos(), angle.sin(), 0.0);
        assert!((angle_between(DVec3::X * 1e-200, b * 1e200) / angle - 1.0).abs() < 1e-15, "{angle}");
    }
    let (a, b) = (DVec3::X, DVec3::new(-1.0, 1e-9, 0.0));
    assert!((PI - angle_between(a, b) - 1e-9).abs() < 1e-15);
    assert_eq!(angle_between(DVec3::X, DVec3::X * 3.0), 0.0);
    assert!(angle_between(DVec3::X, DVec3::ZERO).is_nan());
}

#[test]
#[ignore = "a measurement: run in release"]
fn what_maps_cost() {
    let mut seeded = Seeded::new(23);
    let maps: Vec<Transform> = (0..256).map(|_| any_map(&mut seeded)).collect();
    let time = |name: &str, f: &dyn Fn(&Transform) -> f64| {
        let least = (0..200).map(|_| {
            let start = std::time::Instant::now();
            let sum: f64 = maps.iter().map(f).sum();
            start.elapsed().as_nanos() / maps.len() as u128 + sum.is_nan() as u128
        });
        println!("{name}: {:?} ns", least.min());
    };
    time("new", &|m| Transform::new(m.affine()).unwrap().linear().x_axis.x);
    time("then", &|m| m.then(&Transform::translation(DVec3::X)).unwrap().linear().x_axis.x);
    time("parts", &|m| Parts::of(m).rotation.w);
    time("ray", &|m| m.ray(&Ray::new(DVec3::ONE, DVec3::Z)).origin.x);
}
