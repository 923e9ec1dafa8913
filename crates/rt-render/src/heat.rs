//! [`heat`]: what rays cost, in colour.

use crate::{Film, Picture, glyphs};
use core::fmt;
use rt_accel::Counts;
use rt_geom::glam::Vec3;

/// Which cost is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// Nodes opened.
    Nodes,
    /// Primitives tested.
    Tests,
}

impl Measure {
    fn of(self, counts: &Counts) -> u64 {
        match self {
            Measure::Nodes => counts.nodes,
            Measure::Tests => counts.prims,
        }
    }
}

/// What the colours mean. `Display` says it in a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Which cost is shown.
    pub measure: Measure,
    /// The cost at the bright end; the dark end is 0. At least 99.5 % of the rays cost no more.
    pub top: u64,
    /// The mean of all rays.
    pub mean: f64,
    /// The greatest of all rays.
    pub max: u64,
}

impl fmt::Display for Scale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = match self.measure {
            Measure::Nodes => "nodes opened",
            Measure::Tests => "primitives tested",
        };
        let Scale { top, mean, max, .. } = self;
        write!(f, "{what} per eye ray: dark is 0, bright is {top}; mean {mean:.2}, most {max}")
    }
}

/// A picture of what each ray cost, with a colour bar at its right edge, and what its colours mean. `costs` are those of
/// [`Film::cost`].
///
/// The colours are viridis: dark blue over green to yellow, each step as visible as the next, and right in grey too. Costs
/// beyond the top of the scale have the colour of the top, which the bar then marks with a plus.
///
/// Source of the colours: van der Walt and Smith, matplotlib 1.5 (2015).
///
/// ```
/// use rt_accel::Counts;
/// use rt_render::{Film, Measure, heat};
/// let film = Film::new(64, 64);
/// let costs: Vec<Counts> = (0..65 * 65).map(|i| Counts { nodes: i % 65, ..Counts::default() }).collect();
/// let (picture, scale) = heat(&film, Measure::Nodes, &costs);
/// assert!(picture.width > 64 && picture.height == 64);
/// assert_eq!((scale.max, scale.mean), (64, 32.0));
/// ```
pub fn heat(film: &Film, measure: Measure, costs: &[Counts]) -> (Picture, Scale) {
    let [width, height] = film.size();
    let mut sorted: Vec<u64> = costs.iter().map(|counts| measure.of(counts)).collect();
    sorted.sort_unstable();
    let most = sorted.last().copied().unwrap_or(0);
    let nearly = sorted.get(sorted.len() * 995 / 1000).copied().unwrap_or(0);
    let top = round_up(nearly.max(1));
    let mean = sorted.iter().map(|&cost| cost as f64).sum::<f64>() / sorted.len().max(1) as f64;
    let scale = Scale { measure, top, mean, max: most };

    // Costs are averaged to pixels before they are coloured: a colour between two colours would mean a third cost.
    let mut corners: Vec<[f32; 3]> = costs.iter().map(|counts| [measure.of(counts) as f32; 3]).collect();
    corners.resize((width as usize + 1) * (height as usize + 1), [0.0; 3]);
    let pixels = film.develop(&corners);

    let dot = (height / 256).max(1);
    let bar = 8 * dot;
    let left = width + 4 * dot;
    let mut picture = Picture::new(left + bar + 8 * glyphs::ADVANCE * dot, height);
    for y in 0..height {
        for x in 0..width {
            let cost = pixels.pixels[y as usize * width as usize + x as usize][0];
            glyphs::fill(&mut picture, [x, y], [1, 1], color(cost / top as f32));
        }
    }
    let text = glyphs::HEIGHT * dot;
    let title = match measure {
        Measure::Nodes => "NODES",
        Measure::Tests => "TESTS",
    };
    glyphs::write(&mut picture, [left, 2 * dot], dot, title);
    let (from, to) = (4 * dot + 2 * text, height.saturating_sub(2 * dot + text / 2));
    let length = to.saturating_sub(from);
    for y in 0..length {
        let share = 1.0 - y as f32 / (length - 1).max(1) as f32;
        glyphs::fill(&mut picture, [left, from + y], [bar, 1], color(share));
    }
    // As many labels as fit, of those that divide the top.
    let steps = [4u64, 2, 1].into_iter().find(|&n| u64::from(length) >= n * u64::from(2 * text)).unwrap_or(1);
    for i in 0..=steps {
        let y = to - (u64::from(length) * i / steps) as u32;
        let plus = if i == steps && most > top { "+" } else { "" };
        let label = format!("{}{plus}", short(top as f64 * i as f64 / steps as f64));
        glyphs::fill(&mut picture, [left + bar, y.min(to.saturating_sub(1))], [dot, 1], [1.0; 3]);
        glyphs::write(&mut picture, [left + bar + 2 * dot, y.saturating_sub(text / 2)], dot, &label);
    }
    (picture, scale)
}

/// The least of 1, 2, 4, 6, 8, 10, 20, 40 ... that is not below `cost`.
fn round_up(cost: u64) -> u64 {
    let mut unit = 1u64;
    loop {
        for step in [1, 2, 4, 6, 8] {
            match unit.checked_mul(step) {
                Some(nice) if nice < cost => {}
                Some(nice) => return nice,
                None => return u64::MAX,
            }
        }
        unit = unit.saturating_mul(10);
    }
}

/// A number in at most five characters, as far as it has no more digits that matter.
fn short(x: f64) -> String {
    let (x, unit) = match x {
        x if x >= 1e6 => (x / 1e6, "M"),
        x if x >= 1e4 => (x / 1e3, "k"),
        x => (x, ""),
    };
    let text =
        if x == x.trunc() { format!("{x}") } else { format!("{x:.2}").trim_end_matches('0').to_string() };
    text + unit
}

/// Nine colours of viridis, evenly spaced.
const VIRIDIS: [[u8; 3]; 9] = [
    [0x44, 0x01, 0x54],
    [0x47, 0x2d, 0x7b],
    [0x3b, 0x52, 0x8b],
    [0x2c, 0x72, 0x8e],
    [0x21, 0x90, 0x8c],
    [0x27, 0xad, 0x81],
    [0x5d, 0xc8, 0x63],
    [0xaa, 0xdc, 0x32],
    [0xfd, 0xe7, 0x25],
];

/// The colour of a share of the scale, 0 to 1.
fn color(share: f32) -> [f32; 3] {
    let at = share.clamp(0.0, 1.0) * (VIRIDIS.len() - 1) as f32;
    let below = (at as usize).min(VIRIDIS.len() - 2);
    let point = |i: usize| Vec3::from(VIRIDIS[i].map(|c| f32::from(c) / 255.0));
    point(below).lerp(point(below + 1), at - below as f32).to_array()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_is_brighter() {
        let luminance = |share: f32| Vec3::from(color(share)).dot(Vec3::new(0.2126, 0.7152, 0.0722));
        assert!((0..200).all(|i| luminance((i + 1) as f32 / 200.0) > luminance(i as f32 / 200.0)));
        assert_eq!(color(7.0), color(1.0));
        assert_eq!(color(f32::NAN).map(f32::is_nan), [true; 3]);
    }

    #[test]
    fn scales_have_round_ends() {
        let nice = [(1, 1), (2, 2), (3, 4), (9, 10), (11, 20), (61, 80), (81, 100), (u64::MAX, u64::MAX)];
        assert!(nice.iter().all(|&(cost, top)| round_up(cost) == top));
        let texts = [(0.0, "0"), (0.25, "0.25"), (1.5, "1.5"), (750.0, "750"), (25e3, "25k"), (15e5, "1.5M")];
        assert!(texts.iter().all(|&(x, text)| short(x) == text));
    }

    #[test]
    fn tiny_pictures_and_no_costs_do_no_harm() {
        for (w, h) in [(1, 1), (3, 9), (40, 12)] {
            let (picture, scale) = heat(&Film::new(w, h), Measure::Tests, &[]);
            assert_eq!((picture.height, scale.top, scale.max), (h, 1, 0));
        }
    }
}
