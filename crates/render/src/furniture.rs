//! Heading, key and compass.
//!
//! **Input** what to say and the page. **Output** groups of marks.
//! The key holds the colour bar with its ticks and the scale bar; it is measured before the page is laid out, so
//! that the tree can leave room.

use glam::{DVec2, DVec3};

use crate::coloring::{Coloring, Scale, Tick};
use crate::drawing::{Group, Mark};
use crate::page::Page;
use crate::palette::{PageColors, Palette};
use crate::params::{Compass, Params};
use crate::text::{Anchor, Face};
use crate::unit::{self, LengthUnit};

/// Font sizes in layout units.
const TITLE: f64 = 2.0;
const BODY: f64 = 1.3;
const SMALL: f64 = 1.2;
/// Line height over font size.
const LEADING: f64 = 1.4;
/// Size of the colour bar in layout units.
const BAR: DVec2 = DVec2::new(1.4, 15.0);
/// Names beside the colour bar; what is more is counted.
const MAX_NAMES: usize = 12;
/// Height of the scale bar with its text, and its largest length.
const SCALE_BAR: DVec2 = DVec2::new(11.0, 3.4);

/// What the heading says.
#[derive(Clone, Debug, Default)]
pub(crate) struct Heading {
    /// The title.
    pub title: Option<String>,
    /// The verdict, in parts.
    pub verdict: Vec<String>,
    /// Further facts, in parts.
    pub facts: Vec<String>,
}

/// The heading at the top of a page, and its height in pixels.
pub(crate) fn heading(face: &Face, said: &Heading, width: u32, colors: &PageColors) -> (Group, f64) {
    let unit = Page::unit_px(width);
    let margin = Page::margin_px(width);
    let room = (f64::from(width) - 2.0 * margin) as f32;
    let mut marks = Vec::new();
    let mut y = margin;
    let title: Vec<String> = said.title.iter().cloned().collect();
    let (n_verdicts, n_facts) = if Page::is_thumbnail(width) { (1, 0) } else { (usize::MAX, usize::MAX) };
    let first = |parts: &[String], n: usize| parts[..n.min(parts.len())].to_vec();
    for (parts, size, color, is_strong) in [
        (&title, TITLE * unit, colors.ink, true),
        (&first(&said.verdict, n_verdicts), BODY * unit, colors.ink, false),
        (&first(&said.facts, n_facts), BODY * unit, colors.soft, false),
    ] {
        for text in face.lines(parts, size as f32, room) {
            let at = DVec2::new(margin, y + 0.8 * size);
            marks.push(Mark::Text { at, size_px: size, anchor: Anchor::Start, is_strong, color, text });
            y += LEADING * size;
        }
    }
    (Group { name: "heading", marks }, y - margin)
}

/// The size of the key in pixels.
pub(crate) fn key_size(face: &Face, coloring: &Coloring, width: u32) -> DVec2 {
    let unit = Page::unit_px(width);
    let bar = shown_scale(coloring, width).map_or(DVec2::ZERO, |(_, scale)| {
        let texts = scale.ticks.iter().map(|tick| face.width(&tick.text, (SMALL * unit) as f32));
        let caption = f64::from(face.width(&scale.caption, (BODY * unit) as f32));
        let ticks = BAR.x * unit + unit + f64::from(texts.fold(0.0, f32::max));
        DVec2::new(caption.max(ticks), (BAR.y + 3.4) * unit)
    });
    DVec2::new(bar.x.max(SCALE_BAR.x * unit), bar.y + SCALE_BAR.y * unit)
}

/// The key: colour bar and scale bar.
pub(crate) fn key(page: &Page, coloring: &Coloring, params: &Params, colors: &PageColors) -> Vec<Group> {
    let unit = page.unit_px;
    let mut groups = Vec::new();
    let mut at = page.key_at;
    if let Some((palette, scale)) = shown_scale(coloring, page.width) {
        groups.push(color_bar(at, unit, (palette, &scale), colors));
        at.y += (BAR.y + 3.4) * unit;
    }
    groups.extend(scale_bar(page, at, params, colors));
    groups
}

/// The scale with its colours, if the page has room for it; of many names the first.
fn shown_scale(coloring: &Coloring, width: u32) -> Option<(Palette, Scale)> {
    let scale = coloring.scale.as_ref().filter(|_| !Page::is_thumbnail(width))?;
    let n_names = scale.ticks.len();
    if coloring.palette.is_continuous || n_names <= MAX_NAMES {
        return Some((coloring.palette.clone(), scale.clone()));
    }
    let is_from_top = scale.ticks[0].position > scale.ticks[n_names - 1].position;
    let share = MAX_NAMES as f64 / coloring.palette.len() as f64;
    let (palette, low) = if is_from_top {
        (coloring.palette.last(MAX_NAMES), 1.0 - share)
    } else {
        (coloring.palette.first(MAX_NAMES), 0.0)
    };
    let placed = |tick: &Tick| Tick { position: (tick.position - low) / share, ..tick.clone() };
    let ticks = scale.ticks.iter().take(MAX_NAMES).map(placed).collect();
    let caption = format!("{}, … and {} more", scale.caption, n_names - MAX_NAMES);
    Some((palette, Scale { caption, ticks }))
}

fn color_bar(at: DVec2, unit: f64, (palette, scale): (Palette, &Scale), colors: &PageColors) -> Group {
    let text = |at: DVec2, size: f64, is_strong: bool, text: &str| Mark::Text {
        at,
        size_px: size * unit,
        anchor: Anchor::Start,
        is_strong,
        color: colors.ink,
        text: text.to_owned(),
    };
    let corner = at + DVec2::new(0.0, 2.4 * unit);
    let size = BAR * unit;
    let mut marks = vec![
        text(at + DVec2::new(0.0, BODY * unit), BODY, false, &scale.caption),
        Mark::Bar { corner, size, palette },
    ];
    for (from, to) in
        [(DVec2::ZERO, DVec2::X), (DVec2::X, DVec2::ONE), (DVec2::ONE, DVec2::Y), (DVec2::Y, DVec2::ZERO)]
    {
        let width_px = 0.06 * unit;
        marks.push(Mark::Line {
            from: corner + from * size,
            to: corner + to * size,
            width_px,
            color: colors.soft,
        });
    }
    for tick in &scale.ticks {
        let y = corner.y + size.y * (1.0 - tick.position);
        let left = if tick.is_mean { corner.x } else { corner.x + size.x };
        marks.push(Mark::Line {
            from: DVec2::new(left, y),
            to: DVec2::new(corner.x + size.x + 0.5 * unit, y),
            width_px: if tick.is_mean { 0.14 } else { 0.09 } * unit,
            color: colors.ink,
        });
        let baseline = DVec2::new(corner.x + size.x + 0.9 * unit, y + 0.36 * SMALL * unit);
        marks.push(text(baseline, SMALL, tick.is_mean, &tick.text));
    }
    Group { name: "legend", marks }
}

/// The scale bar: a round length, at most [`SCALE_BAR`] units long. None where the tree has no size.
pub(crate) fn scale_bar(page: &Page, at: DVec2, params: &Params, colors: &PageColors) -> Option<Group> {
    let unit = page.unit_px;
    let longest_mm = SCALE_BAR.x * unit / page.px_per_mm;
    if longest_mm < 1e-9 {
        return None;
    }
    let length_unit = LengthUnit::choose(params.unit, unit::round_down(longest_mm));
    let length = unit::round_down(longest_mm / length_unit.mm);
    let length_px = length * length_unit.mm * page.px_per_mm;
    let y = at.y + 2.6 * unit;
    let line = |from: DVec2, to: DVec2, width: f64| Mark::Line {
        from,
        to,
        width_px: width * unit,
        color: colors.ink,
    };
    let (left, right) = (DVec2::new(at.x, y), DVec2::new(at.x + length_px, y));
    let end = DVec2::new(0.0, 0.45 * unit);
    let marks = vec![
        line(left, right, 0.25),
        line(left - end, left + end, 0.14),
        line(right - end, right + end, 0.14),
        Mark::Text {
            at: DVec2::new(0.5 * (left.x + right.x), y - 0.75 * unit),
            size_px: BODY * unit,
            anchor: Anchor::Middle,
            is_strong: false,
            color: colors.ink,
            text: format!("{} {}", unit::text(length, 3), length_unit.sign),
        },
    ];
    Some(Group { name: "scale-bar", marks })
}

/// The letters at the edges of the area: which way the picture's right, left, up and down point in the body.
pub(crate) fn compass(
    page: &Page,
    [right, up]: [DVec3; 2],
    kind: Compass,
    colors: &PageColors,
) -> Option<Group> {
    let unit = page.unit_px;
    let [low, high] = page.area;
    let middle = 0.5 * (low + high);
    let size_px = 1.6 * unit;
    let drop = 0.36 * size_px;
    let marks = [
        (right, DVec2::new(high.x, middle.y + drop), Anchor::End),
        (-right, DVec2::new(low.x, middle.y + drop), Anchor::Start),
        (up, DVec2::new(middle.x, low.y + 0.75 * size_px), Anchor::Middle),
        (-up, DVec2::new(middle.x, high.y), Anchor::Middle),
    ]
    .into_iter()
    .filter_map(|(direction, at, anchor)| {
        let text = direction_letters(direction, kind)?;
        Some(Mark::Text { at, size_px, anchor, is_strong: true, color: colors.ink, text })
    })
    .collect();
    (kind != Compass::None).then_some(Group { name: "compass", marks })
}

/// The letters of a direction in RAS, the strongest first; an axis within 20° of the picture's plane normal to it
/// is left out.
pub(crate) fn direction_letters(direction: DVec3, kind: Compass) -> Option<String> {
    let names = match kind {
        Compass::Auto | Compass::Anatomical => [["R", "L"], ["A", "P"], ["S", "I"]],
        Compass::Axes => [["+x ", "−x "], ["+y ", "−y "], ["+z ", "−z "]],
        Compass::None => return None,
    };
    let mut parts: Vec<(f64, &str)> = (0..3)
        .map(|axis| (direction[axis].abs(), names[axis][usize::from(direction[axis] < 0.0)]))
        // sin 20°.
        .filter(|&(part, _)| part > 0.342)
        .collect();
    parts.sort_by(|a, b| b.0.total_cmp(&a.0));
    Some(parts.iter().map(|&(_, name)| name).collect::<String>().trim_end().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters() {
        for (direction, letters, axes) in [
            (DVec3::X, "R", "+x"),
            (DVec3::NEG_Z, "I", "−z"),
            (DVec3::new(-0.8, 0.6, 0.0), "LA", "−x +y"),
            (DVec3::new(0.1, -0.995, 0.0), "P", "−y"),
        ] {
            assert_eq!(direction_letters(direction, Compass::Anatomical).as_deref(), Some(letters));
            assert_eq!(direction_letters(direction, Compass::Axes).as_deref(), Some(axes));
        }
        assert_eq!(direction_letters(DVec3::X, Compass::None), None);
    }
}
