//! The map as PDF: the same page as the PNG, at 300 pixels to an inch, with lines and text that stay lines and text.
//!
//! **Input** the page, its marks, and the lit surface as pixels, or the branches as paths. **Output** a PDF 1.7 file of one
//! page.
//! **Steps** 1. Pixels go into one image, packed as in a PNG. Lines and ribbons are paths. 2. Marks are paths and text in
//! the built-in face, of which only the glyphs in use go into the file, so that text can be searched, copied and edited.
//! **Guarantees** the same bytes for the same page: no date, no identifier, no name but the title.
//! **Source** ISO 32000-1. The image's stream is PNG's (predictor 15 of its table 10).
//! **Cost** that of packing the image.

use std::collections::BTreeMap;

use glam::DVec2;
use pdf_writer::types::{
    CidFontType, FontFlags, LineCapStyle, LineJoinStyle, SystemInfo, TextRenderingMode, UnicodeCmap,
};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, Str, TextStr};

use crate::Error;
use crate::drawing::{Group, Mark};
use crate::outline::{Piece, disc, outline, polyline};
use crate::page::Page;
use crate::paint::{PLAIN, STRONG};
use crate::palette::{PageColors, Rgb};
use crate::params::Style;
use crate::shade;
use crate::svg::{self, Ribbon};
use crate::text::{Anchor, Face, GlyphAt};

/// Points to a pixel at 300 pixels to an inch.
const PT_PER_PX: f32 = 72.0 / 300.0;
/// Boxes of a continuous colour bar.
const N_BANDS: usize = 256;

const CATALOG: Ref = Ref::new(1);
const PAGES: Ref = Ref::new(2);
const PAGE: Ref = Ref::new(3);
const CONTENT: Ref = Ref::new(4);
const IMAGE: Ref = Ref::new(5);
const FONT: Ref = Ref::new(6);
const CID_FONT: Ref = Ref::new(7);
const DESCRIPTOR: Ref = Ref::new(8);
const FONT_FILE: Ref = Ref::new(9);
const TO_UNICODE: Ref = Ref::new(10);
const INFO: Ref = Ref::new(11);
const MAP: Ref = Ref::new(12);

/// The tree on its page.
#[derive(Debug)]
pub(crate) enum Drawn {
    /// The rows of the whole page without its marks, as a zlib stream of PNG-filtered RGB.
    Pixels(Vec<u8>),
    /// Closed paths to be filled, each with its colour and the colour of its outline.
    Filled(Vec<(Vec<Piece>, Rgb, Rgb)>),
    /// Lines of a width.
    Lines(Vec<(Vec<Piece>, Rgb)>, f64),
}

impl Drawn {
    /// The tree as the page's style has it; `stream` are the pixels of a pseudo-surface.
    pub(crate) fn of(content: &svg::Content<'_>, page: &Page, colors: &PageColors, stream: Vec<u8>) -> Self {
        let ribbons = || {
            let list = content.branches.list();
            svg::drawing_order(content).into_iter().map(|branch| Ribbon::of(content, page, &list[branch]))
        };
        let rim = shade::mix(colors.background, colors.rim, 0.75);
        if content.branches.list().is_empty() && !page.pen.style.is_pixels() {
            let center = page.px(content.scene.points_mm[0].truncate());
            let color = content.coloring.palette.at(content.coloring.ends[0][0]);
            return Self::Filled(vec![(disc(center, page.radius_px(content.scene.radii_mm[0])), color, rim)]);
        }
        match page.pen.style {
            Style::PseudoSurface | Style::Volume => Self::Pixels(stream),
            Style::Line => {
                let line = |ribbon: Ribbon| (polyline(&ribbon.discs), ribbon.color);
                Self::Lines(ribbons().map(line).collect(), page.pen.min_width_px)
            }
            Style::Ribbon => {
                Self::Filled(ribbons().map(|ribbon| (outline(&ribbon.discs), ribbon.color, rim)).collect())
            }
        }
    }
}

/// Writes the file.
pub(crate) fn pdf(
    page: &Page,
    (drawn, groups): (Drawn, &[Group]),
    (background, face): (Rgb, &Face),
    title: &str,
) -> Result<Vec<u8>, Error> {
    let (width, height) = (page.width as f32 * PT_PER_PX, page.height as f32 * PT_PER_PX);
    let mut ink = Ink { content: Content::new(), face, glyphs: BTreeMap::new() };
    // From here on in pixels, y down.
    ink.content.transform([PT_PER_PX, 0.0, 0.0, -PT_PER_PX, 0.0, height]);
    ink.fill(background);
    ink.content.rect(0.0, 0.0, page.width as f32, page.height as f32).fill_nonzero();
    ink.tree(page, &drawn);
    for mark in groups.iter().flat_map(|group| &group.marks) {
        ink.mark(mark);
    }

    let mut file = Pdf::new();
    file.catalog(CATALOG).pages(PAGES);
    file.pages(PAGES).kids([PAGE]).count(1);
    let mut sheet = file.page(PAGE);
    sheet.media_box(Rect::new(0.0, 0.0, width, height)).parent(PAGES).contents(CONTENT);
    let mut resources = sheet.resources();
    resources.fonts().pair(Name(b"F"), FONT);
    if matches!(drawn, Drawn::Pixels(_)) {
        resources.x_objects().pair(Name(b"Tree"), IMAGE);
    }
    resources.finish();
    sheet.finish();
    file.document_info(INFO).title(TextStr(title)).creator(TextStr("espalier"));
    let Ink { content, glyphs, .. } = ink;
    file.stream(CONTENT, &deflated(&content.finish())).filter(Filter::FlateDecode);
    if let Drawn::Pixels(stream) = drawn {
        image(&mut file, page, &stream);
    }
    font(&mut file, face, &glyphs)?;
    Ok(file.finish())
}

fn image(file: &mut Pdf, page: &Page, stream: &[u8]) {
    let mut image = file.image_xobject(IMAGE, stream);
    image.width(page.width as i32).height(page.height as i32).bits_per_component(8);
    image.color_space().device_rgb();
    image.filter(Filter::FlateDecode);
    image
        .decode_parms()
        .predictor(pdf_writer::types::Predictor::PngOptimum)
        .colors(3)
        .columns(page.width as i32);
}

/// The face with the glyphs in use, by their numbers in the file.
fn font(file: &mut Pdf, face: &Face, glyphs: &BTreeMap<u16, char>) -> Result<(), Error> {
    let mut remapper = subsetter::GlyphRemapper::new();
    for &glyph in glyphs.keys() {
        remapper.remap(glyph);
    }
    let subset = subsetter::subset(face.bytes(), 0, &remapper)?;
    let name = Name(b"ESPALR+Ubuntu-Light");
    file.type0_font(FONT)
        .base_font(name)
        .encoding_predefined(Name(b"Identity-H"))
        .descendant_font(CID_FONT)
        .to_unicode(TO_UNICODE);
    let system = SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"Identity"), supplement: 0 };
    let mut cid = file.cid_font(CID_FONT);
    cid.subtype(CidFontType::Type2).base_font(name).system_info(system).font_descriptor(DESCRIPTOR);
    // Content names glyphs by their numbers in the face; the file has them by new ones.
    let mut map = Vec::new();
    let last = glyphs.keys().next_back().copied().unwrap_or(0);
    for glyph in 0..=last {
        map.extend(remapper.get(glyph).unwrap_or(0).to_be_bytes());
    }
    cid.cid_to_gid_map_stream(MAP);
    cid.default_width(0.0);
    let mut widths = cid.widths();
    for &glyph in glyphs.keys() {
        widths.same(glyph, glyph, 1000.0 * face.advance(glyph));
    }
    widths.finish();
    cid.finish();
    file.stream(MAP, &deflated(&map)).filter(Filter::FlateDecode);
    let (ascent, descent) = face.extent();
    file.font_descriptor(DESCRIPTOR)
        .name(name)
        .flags(FontFlags::SYMBOLIC)
        .bbox(Rect::new(-200.0, 1000.0 * descent, 1400.0, 1000.0 * ascent))
        .italic_angle(0.0)
        .ascent(1000.0 * ascent)
        .descent(1000.0 * descent)
        .cap_height(693.0)
        .stem_v(50.0)
        .font_file2(FONT_FILE);
    file.stream(FONT_FILE, &deflated(&subset)).filter(Filter::FlateDecode);
    let mut letters = UnicodeCmap::new(Name(b"Custom"), system);
    for (&glyph, &letter) in glyphs {
        letters.pair(glyph, letter);
    }
    file.cmap(TO_UNICODE, &letters.finish());
    Ok(())
}

/// What is drawn so far, in pixels.
struct Ink<'a> {
    content: Content,
    face: &'a Face,
    /// The glyphs in use, each with its letter.
    glyphs: BTreeMap<u16, char>,
}

impl Ink<'_> {
    fn fill(&mut self, [r, g, b]: Rgb) {
        self.content.set_fill_rgb(r, g, b);
    }

    fn stroke(&mut self, [r, g, b]: Rgb, width_px: f64) {
        self.content.set_stroke_rgb(r, g, b).set_line_width(width_px as f32);
    }

    fn tree(&mut self, page: &Page, drawn: &Drawn) {
        self.content
            .save_state()
            .set_line_cap(LineCapStyle::RoundCap)
            .set_line_join(LineJoinStyle::RoundJoin);
        match drawn {
            Drawn::Pixels(_) => {
                let [width, height] = [page.width, page.height].map(|pixels| pixels as f32);
                self.content.transform([width, 0.0, 0.0, -height, 0.0, height]).x_object(Name(b"Tree"));
            }
            Drawn::Filled(branches) => {
                // All outlines first, so that a branch does not cut its parent off.
                for (path, _, rim) in branches {
                    self.stroke(*rim, 1.3);
                    self.path(path);
                    self.content.close_path().stroke();
                }
                for (path, color, _) in branches {
                    self.fill(*color);
                    self.path(path);
                    self.content.fill_nonzero();
                }
            }
            Drawn::Lines(branches, width_px) => {
                for (path, color) in branches {
                    self.stroke(*color, *width_px);
                    self.path(path);
                    self.content.stroke();
                }
            }
        }
        self.content.restore_state();
    }

    fn path(&mut self, pieces: &[Piece]) {
        let mut at = DVec2::ZERO;
        for piece in pieces {
            match *piece {
                Piece::Move(to) => {
                    self.content.move_to(to.x as f32, to.y as f32);
                    at = to;
                }
                Piece::Line(to) => {
                    self.content.line_to(to.x as f32, to.y as f32);
                    at = to;
                }
                Piece::Arc { center, radius, to } => {
                    self.arc((center, radius), at, to);
                    at = to;
                }
            }
        }
    }

    /// At most half a circle, clockwise as seen with y down, as two curves over its middle.
    fn arc(&mut self, (center, radius): (DVec2, f64), from: DVec2, to: DVec2) {
        let [a, b] = [from, to].map(|point| (point - center).normalize_or(DVec2::X));
        // The bisector, or a quarter turn on where the ends lie opposite each other.
        let quarter = DVec2::new(-a.y, a.x);
        let middle =
            if a.dot(b) > -0.999_999 && a.perp_dot(b) >= 0.0 { (a + b).normalize() } else { quarter };
        for (p, q) in [(a, middle), (middle, b)] {
            // Control points lie on the tangents, 4/3 tan(¼ turn) radii away; tan(¼ turn) from the half turn's cosine.
            let half = (0.5 * (1.0 + p.dot(q).clamp(-1.0, 1.0))).sqrt();
            let tan = ((1.0 - half).max(0.0) / (1.0 + half)).sqrt();
            let reach = 4.0 / 3.0 * tan;
            let [c, d] = [p + reach * DVec2::new(-p.y, p.x), q - reach * DVec2::new(-q.y, q.x)];
            let [c, d, q] = [c, d, q].map(|unit| center + radius * unit);
            self.content.cubic_to(c.x as f32, c.y as f32, d.x as f32, d.y as f32, q.x as f32, q.y as f32);
        }
    }

    fn mark(&mut self, mark: &Mark) {
        match mark {
            Mark::Text { at, size_px, anchor, is_strong, color, text } => {
                self.fill(*color);
                self.stroke(*color, size_px * f64::from(if *is_strong { STRONG } else { PLAIN }));
                self.text(text, *size_px as f32, *anchor, *at);
            }
            Mark::Line { from, to, width_px, color } => {
                self.stroke(*color, *width_px);
                self.content.move_to(from.x as f32, from.y as f32).line_to(to.x as f32, to.y as f32).stroke();
            }
            Mark::Bent { points, width_px, color } => {
                self.stroke(*color, *width_px);
                let places: Vec<(DVec2, f64)> = points.iter().map(|&at| (at, 0.0)).collect();
                self.path(&polyline(&places));
                self.content.stroke();
            }
            Mark::Ring { center, radius_px, width_px, color } => {
                self.stroke(*color, *width_px);
                self.path(&disc(*center, *radius_px));
                self.content.close_path().stroke();
            }
            Mark::Bar { corner, size, palette } => {
                let n_bands = if palette.is_continuous { N_BANDS } else { palette.len() };
                for band in (0..n_bands).rev() {
                    // Each covers all below it, so that no paper shines through.
                    let share = (band + 1) as f64 / n_bands as f64;
                    self.fill(palette.at((band as f32 + 0.5) / n_bands as f32));
                    let top = corner.y + size.y * (1.0 - share);
                    let [x, y, width, height] =
                        [corner.x, top, size.x, size.y * share].map(|number| number as f32);
                    self.content.rect(x, y, width, height).fill_nonzero();
                }
            }
        }
    }

    fn text(&mut self, text: &str, size_px: f32, anchor: Anchor, at: DVec2) {
        let left = at.x as f32 - anchor.share() * self.face.width(text, size_px);
        self.content.begin_text().set_font(Name(b"F"), size_px);
        self.content.set_text_rendering_mode(TextRenderingMode::FillStroke);
        self.content.set_text_matrix([1.0, 0.0, 0.0, -1.0, left, at.y as f32]);
        let placed = self.face.glyphs(text);
        let mut shown = self.content.show_positioned();
        let mut items = shown.items();
        let mut pen = 0.0;
        for GlyphAt { glyph, letter, pen_em } in placed {
            // What kerning moves, to the left, in thousandths.
            if (pen - pen_em).abs() > 1e-6 {
                items.adjust(1000.0 * (pen - pen_em));
            }
            items.show(Str(&glyph.to_be_bytes()));
            pen = pen_em + self.face.advance(glyph);
            self.glyphs.entry(glyph).or_insert(letter);
        }
        items.finish();
        shown.finish();
        self.content.end_text();
    }
}

/// A zlib stream.
fn deflated(bytes: &[u8]) -> Vec<u8> {
    let mut packed = Vec::with_capacity(bytes.len() + bytes.len() / 8 + 1024);
    let mut packer = flate2::Compress::new(flate2::Compression::new(6), true);
    // The buffer has room for what cannot be made smaller, so there is nothing to fail.
    let _ = packer.compress_vec(bytes, &mut packed, flate2::FlushCompress::Finish);
    packed
}
