//! Text as outlines.
//!
//! **Input** a string and a size. **Output** its width, its outline, its lines.
//! The face is Ubuntu Light, which the crate `epaint_default_fonts` carries under the Ubuntu Font Licence 1.0;
//! that licence leaves pictures made with the font alone.

use ab_glyph::{Font, FontRef, OutlineCurve, Point};
use tiny_skia::{Path, PathBuilder};

use crate::Error;

/// Where the given point lies in a line of text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Anchor {
    /// At its left end.
    Start,
    /// In its middle.
    Middle,
    /// At its right end.
    End,
}

impl Anchor {
    /// The share of a line's width that lies to the left of the point.
    pub(crate) fn share(self) -> f32 {
        match self {
            Self::Start => 0.0,
            Self::Middle => 0.5,
            Self::End => 1.0,
        }
    }
}

/// A glyph of a line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GlyphAt {
    /// Its number in the face.
    pub glyph: u16,
    /// What it stands for.
    pub letter: char,
    /// How far from the start of the line, in ems.
    pub pen_em: f32,
}

/// A font face.
#[derive(Debug)]
pub(crate) struct Face {
    font: FontRef<'static>,
    per_em: f32,
}

impl Face {
    /// The built-in face.
    pub(crate) fn built_in() -> Result<Self, Error> {
        let font = FontRef::try_from_slice(epaint_default_fonts::UBUNTU_LIGHT)?;
        let per_em = 1.0 / font.units_per_em().unwrap_or(1000.0);
        Ok(Self { font, per_em })
    }

    /// The width of a line at `size_px` per em, in pixels.
    pub(crate) fn width(&self, text: &str, size_px: f32) -> f32 {
        self.walk(text, |_, _, _| {}) * self.per_em * size_px
    }

    /// The glyphs of a line.
    pub(crate) fn glyphs(&self, text: &str) -> Vec<GlyphAt> {
        let mut glyphs = Vec::new();
        self.walk(text, |glyph, letter, pen| {
            glyphs.push(GlyphAt { glyph: glyph.0, letter, pen_em: pen * self.per_em });
        });
        glyphs
    }

    /// How far a glyph moves the pen, in ems.
    pub(crate) fn advance(&self, glyph: u16) -> f32 {
        self.font.h_advance_unscaled(ab_glyph::GlyphId(glyph)) * self.per_em
    }

    /// How far the face reaches above and below the baseline, in ems; below is under 0.
    pub(crate) fn extent(&self) -> (f32, f32) {
        (self.font.ascent_unscaled() * self.per_em, self.font.descent_unscaled() * self.per_em)
    }

    /// The face's file.
    pub(crate) fn bytes(&self) -> &'static [u8] {
        epaint_default_fonts::UBUNTU_LIGHT
    }

    /// The outline of a line whose baseline passes through (x, y).
    pub(crate) fn path(&self, text: &str, size_px: f32, anchor: Anchor, (x, y): (f32, f32)) -> Option<Path> {
        let left = x - anchor.share() * self.width(text, size_px);
        let scale = self.per_em * size_px;
        let mut builder = PathBuilder::new();
        self.walk(text, |glyph, _, pen| {
            let place = |p: Point| (left + (pen + p.x) * scale, y - p.y * scale);
            if let Some(outline) = self.font.outline(glyph) {
                add_curves(&mut builder, &outline.curves, place);
            }
        });
        builder.finish()
    }

    /// Breaks parts into lines no wider than `room_px`, joined by a middle dot; a part is broken only between
    /// words, and a word never.
    pub(crate) fn lines(&self, parts: &[String], size_px: f32, room_px: f32) -> Vec<String> {
        let mut lines: Vec<String> = Vec::new();
        for part in parts {
            let joined = lines.last().map(|line| format!("{line}  ·  {part}"));
            match joined.filter(|joined| self.width(joined, size_px) <= room_px) {
                Some(joined) => {
                    lines.pop();
                    lines.push(joined);
                }
                None => lines.extend(self.words(part, size_px, room_px)),
            }
        }
        lines
    }

    fn words(&self, part: &str, size_px: f32, room_px: f32) -> Vec<String> {
        let mut lines: Vec<String> = Vec::new();
        for word in part.split_whitespace() {
            let joined = lines.last().map(|line| format!("{line} {word}"));
            match joined.filter(|joined| self.width(joined, size_px) <= room_px) {
                Some(joined) => {
                    lines.pop();
                    lines.push(joined);
                }
                None => lines.push(word.to_owned()),
            }
        }
        lines
    }

    /// Visits each glyph with its pen position in font units; returns the advance of the whole.
    fn walk(&self, text: &str, mut visit: impl FnMut(ab_glyph::GlyphId, char, f32)) -> f32 {
        let (mut pen, mut last) = (0.0, None);
        for letter in text.chars().filter(|letter| !letter.is_control()) {
            let glyph = self.font.glyph_id(letter);
            if let Some(last) = last {
                pen += self.font.kern_unscaled(last, glyph);
            }
            visit(glyph, letter, pen);
            pen += self.font.h_advance_unscaled(glyph);
            last = Some(glyph);
        }
        pen
    }
}

/// The curves of a glyph come without their moves: a curve that does not start where the last ended starts a new
/// contour.
fn add_curves(builder: &mut PathBuilder, curves: &[OutlineCurve], place: impl Fn(Point) -> (f32, f32)) {
    let mut pen: Option<Point> = None;
    for curve in curves {
        let (start, end) = match curve {
            OutlineCurve::Line(start, end)
            | OutlineCurve::Quad(start, _, end)
            | OutlineCurve::Cubic(start, _, _, end) => (*start, *end),
        };
        if pen != Some(start) {
            if pen.is_some() {
                builder.close();
            }
            let (x, y) = place(start);
            builder.move_to(x, y);
        }
        let (x, y) = place(end);
        match curve {
            OutlineCurve::Line(..) => builder.line_to(x, y),
            OutlineCurve::Quad(_, control, _) => {
                let (cx, cy) = place(*control);
                builder.quad_to(cx, cy, x, y);
            }
            OutlineCurve::Cubic(_, first, second, _) => {
                let ((ax, ay), (bx, by)) = (place(*first), place(*second));
                builder.cubic_to(ax, ay, bx, by, x, y);
            }
        }
        pen = Some(end);
    }
    if pen.is_some() {
        builder.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sign_that_we_write_is_in_the_font() {
        let face = Face::built_in().expect("a font");
        for letter in "RLAPSI+−xyz 0123456789.,%°µ≤≥·()θ".chars().filter(|&letter| letter != 'θ') {
            assert_ne!(face.font.glyph_id(letter).0, 0, "{letter:?} is missing");
        }
    }

    #[test]
    fn lines_break_between_parts_and_words() {
        let face = Face::built_in().expect("a font");
        let parts = ["one two".to_owned(), "three".to_owned()];
        assert_eq!(face.lines(&parts, 10.0, 1000.0), ["one two  ·  three"]);
        let room = face.width("one two", 10.0);
        assert_eq!(face.lines(&parts, 10.0, room), ["one two", "three"]);
        assert_eq!(face.lines(&parts, 10.0, 1.0), ["one", "two", "three"]);
        assert!(face.lines(&[], 10.0, 1.0).is_empty());
    }
}
