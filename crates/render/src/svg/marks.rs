//! Marks as SVG: text stays text, a colour bar is a gradient or its steps.

use std::fmt::Write as _;

use espalier_model::xml::escape;
use glam::DVec2;

use crate::drawing::{Group, Mark};
use crate::palette::{Palette, hex};
use crate::text::Anchor;

/// Stops of a gradient in a colour bar.
const N_STOPS: usize = 17;
/// Generic fonts near the one of the PNG.
const FONTS: &str = "Ubuntu, 'Segoe UI', 'Helvetica Neue', Arial, sans-serif";

/// Marks in named groups.
pub(crate) fn write_groups(out: &mut String, groups: &[Group]) {
    for group in groups {
        let _ = writeln!(out, "<g id=\"{}\" font-family=\"{FONTS}\">", group.name);
        for mark in &group.marks {
            write_mark(out, mark);
        }
        out.push_str("</g>\n");
    }
}

fn write_mark(out: &mut String, mark: &Mark) {
    let _ = match mark {
        Mark::Text { at, size_px, anchor, is_strong, color, text } => {
            let anchor = match anchor {
                Anchor::Start => "start",
                Anchor::Middle => "middle",
                Anchor::End => "end",
            };
            let weight = if *is_strong { " font-weight=\"bold\"" } else { "" };
            writeln!(
                out,
                "<text x=\"{:.2}\" y=\"{:.2}\" font-size=\"{size_px:.2}\" text-anchor=\"{anchor}\"{weight} \
                 fill=\"{}\">{}</text>",
                at.x,
                at.y,
                hex(*color),
                escape(text)
            )
        }
        Mark::Line { from, to, width_px, color } => writeln!(
            out,
            "<line x1=\"{:.2}\" y1=\"{:.2}\" x2=\"{:.2}\" y2=\"{:.2}\" stroke=\"{}\" stroke-width=\"{width_px:.2}\"/>",
            from.x,
            from.y,
            to.x,
            to.y,
            hex(*color)
        ),
        Mark::Bent { points, width_px, color } => {
            let places: Vec<String> = points.iter().map(|at| format!("{:.2},{:.2}", at.x, at.y)).collect();
            writeln!(
                out,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width_px:.2}\" \
                 stroke-linejoin=\"round\"/>",
                places.join(" "),
                hex(*color)
            )
        }
        Mark::Bar { corner, size, palette } => {
            write_bar(out, [*corner, *size], palette);
            Ok(())
        }
        Mark::Ring { center, radius_px, width_px, color } => writeln!(
            out,
            "<circle cx=\"{:.2}\" cy=\"{:.2}\" r=\"{radius_px:.2}\" fill=\"none\" stroke=\"{}\" \
             stroke-width=\"{width_px:.2}\"/>",
            center.x,
            center.y,
            hex(*color)
        ),
    };
}

/// A continuous bar is a rectangle with a gradient, one in steps a rectangle for each.
fn write_bar(out: &mut String, [corner, size]: [DVec2; 2], palette: &Palette) {
    if palette.is_continuous {
        out.push_str("<linearGradient id=\"bar\" x1=\"0\" y1=\"1\" x2=\"0\" y2=\"0\">\n");
        for i in 0..N_STOPS {
            let share = i as f32 / (N_STOPS - 1) as f32;
            let _ = writeln!(out, "<stop offset=\"{share:.4}\" stop-color=\"{}\"/>", hex(palette.at(share)));
        }
        out.push_str("</linearGradient>\n");
    }
    let n_boxes = if palette.is_continuous { 1 } else { palette.len() };
    let step = size.y / n_boxes as f64;
    for i in 0..n_boxes {
        let fill =
            if palette.is_continuous { "url(#bar)".to_owned() } else { hex(palette.at(palette.value_of(i))) };
        let _ = writeln!(
            out,
            "<rect x=\"{:.2}\" y=\"{:.2}\" width=\"{:.2}\" height=\"{step:.2}\" fill=\"{fill}\"/>",
            corner.x,
            corner.y + size.y - (i + 1) as f64 * step,
            size.x
        );
    }
}
