//! A few letters and digits, three dots wide and five high: enough to label a scale.

use crate::Picture;

/// Rows of three dots, the top row first, the left dot first.
const GLYPHS: &[(char, [u8; 5])] = &[
    ('0', [0b111, 0b101, 0b101, 0b101, 0b111]),
    ('1', [0b010, 0b110, 0b010, 0b010, 0b111]),
    ('2', [0b111, 0b001, 0b111, 0b100, 0b111]),
    ('3', [0b111, 0b001, 0b111, 0b001, 0b111]),
    ('4', [0b101, 0b101, 0b111, 0b001, 0b001]),
    ('5', [0b111, 0b100, 0b111, 0b001, 0b111]),
    ('6', [0b111, 0b100, 0b111, 0b101, 0b111]),
    ('7', [0b111, 0b001, 0b010, 0b010, 0b010]),
    ('8', [0b111, 0b101, 0b111, 0b101, 0b111]),
    ('9', [0b111, 0b101, 0b111, 0b001, 0b111]),
    ('.', [0b000, 0b000, 0b000, 0b000, 0b010]),
    ('+', [0b000, 0b010, 0b111, 0b010, 0b000]),
    ('k', [0b100, 0b101, 0b110, 0b110, 0b101]),
    ('M', [0b101, 0b111, 0b111, 0b101, 0b101]),
    ('N', [0b110, 0b101, 0b101, 0b101, 0b101]),
    ('O', [0b111, 0b101, 0b101, 0b101, 0b111]),
    ('D', [0b110, 0b101, 0b101, 0b101, 0b110]),
    ('E', [0b111, 0b100, 0b110, 0b100, 0b111]),
    ('S', [0b011, 0b100, 0b010, 0b001, 0b110]),
    ('T', [0b111, 0b010, 0b010, 0b010, 0b010]),
];

/// Width of a character with the gap after it, in dots.
pub(crate) const ADVANCE: u32 = 4;
/// Height of a character, in dots.
pub(crate) const HEIGHT: u32 = 5;

/// Writes `text` in white, its upper left corner at `[x, y]`, each dot `dot` pixels wide. What has no glyph stays empty; what
/// lies outside the picture is cut off.
pub(crate) fn write(picture: &mut Picture, [x, y]: [u32; 2], dot: u32, text: &str) {
    for (i, character) in (0..).zip(text.chars()) {
        let Some((_, rows)) = GLYPHS.iter().find(|(glyph, _)| *glyph == character) else { continue };
        for (row, bits) in (0..).zip(rows) {
            for column in 0..3u32 {
                if bits >> (2 - column) & 1 == 1 {
                    let from = [x + (i * ADVANCE + column) * dot, y + row * dot];
                    fill(picture, from, [dot, dot], [1.0; 3]);
                }
            }
        }
    }
}

/// Fills a rectangle, as far as it lies in the picture.
pub(crate) fn fill(picture: &mut Picture, [x, y]: [u32; 2], [w, h]: [u32; 2], color: [f32; 3]) {
    for row in y..(y + h).min(picture.height) {
        for column in x..(x + w).min(picture.width) {
            picture.pixels[row as usize * picture.width as usize + column as usize] = color;
        }
    }
}
