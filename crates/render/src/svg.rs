//! The map as SVG: one named, editable path per branch.
//!
//! **Input** the scene on its page, colours, marks. **Output** SVG 1.1 text.
//! **Steps** 1. Each branch is one closed outline: along its left side, round its tip, back along its right side,
//! round its start; bends are rounded on the outer side and pivot through the axis on the inner side, so that the
//! nonzero rule fills them. 2. A dark edge under all branches refers to the same paths, so that an edited branch
//! takes its edge along. 3. Marks follow in named groups; text stays text.
//! **Guarantees** coordinates in pixels with 2 decimals; titles and names are escaped; the picture is the same as
//! the PNG but for the light.
//! **Cost** O(nodes).

use std::fmt::Write as _;

use espalier_model::{Branch, Branches, Tree};
use glam::DVec2;

use crate::coloring::Coloring;
use crate::drawing::{Group, Mark};
use crate::page::Page;
use crate::palette::{PageColors, Palette, hex};
use crate::params::Style;
use crate::scene::Scene;
use crate::text::Anchor;

/// Stops of a gradient in a colour bar.
const N_STOPS: usize = 17;
/// Generic fonts near the one of the PNG.
const FONTS: &str = "Ubuntu, 'Segoe UI', 'Helvetica Neue', Arial, sans-serif";
/// Turns with a smaller sine than this are drawn as one mitred corner.
const GENTLE: f64 = 0.2;

/// What the SVG shows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Content<'a> {
    /// The tree.
    pub tree: &'a Tree,
    /// Its branches.
    pub branches: &'a Branches,
    /// Where its nodes lie.
    pub scene: &'a Scene,
    /// Its colours.
    pub coloring: &'a Coloring,
    /// What the document is called.
    pub title: &'a str,
}

/// Writes the document.
pub(crate) fn svg(content: &Content<'_>, page: &Page, groups: &[Group], colors: &PageColors) -> String {
    let (width, height) = (page.width, page.height);
    let mut out = String::new();
    // Writing to a String cannot fail, so the results of write! are dropped throughout.
    let _ = writeln!(
        out,
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" \
         xmlns:xlink=\"http://www.w3.org/1999/xlink\" version=\"1.1\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" data-format=\"espalier-planar-svg\" data-version=\"1\" \
         data-mm-per-px=\"{:.9e}\" data-origin-px=\"{:.2} {:.2}\">\n<title>{}</title>",
        1.0 / page.px_per_mm,
        page.origin_px.x,
        page.origin_px.y,
        escaped(content.title)
    );
    let _ = writeln!(
        out,
        "<rect id=\"background\" width=\"{width}\" height=\"{height}\" fill=\"{}\"/>",
        hex(colors.background)
    );
    tree(&mut out, content, page, colors);
    for group in groups {
        let _ = writeln!(out, "<g id=\"{}\" font-family=\"{FONTS}\">", group.name);
        for mark in &group.marks {
            write_mark(&mut out, mark);
        }
        out.push_str("</g>\n");
    }
    out.push_str("</svg>\n");
    out
}

/// The branches; the root's last, so that a parent covers the starts of its children.
fn tree(out: &mut String, content: &Content<'_>, page: &Page, colors: &PageColors) {
    let list = content.branches.list();
    if list.is_empty() {
        let center = page.px(content.scene.points_mm[0].truncate());
        let radius = page.radius_px(content.scene.radii_mm[0]);
        let fill = hex(content.coloring.palette.at(content.coloring.ends[0][0]));
        let _ = writeln!(
            out,
            "<circle id=\"root\" cx=\"{:.2}\" cy=\"{:.2}\" r=\"{radius:.2}\" fill=\"{fill}\"/>",
            center.x, center.y
        );
        return;
    }
    if page.pen.style == Style::PseudoSurface {
        let rim = hex(colors.rim);
        let _ = writeln!(
            out,
            "<g id=\"edges\" stroke=\"{rim}\" stroke-opacity=\"0.75\" stroke-width=\"1.3\" stroke-linejoin=\"round\">"
        );
        for branch in (0..list.len()).rev() {
            let _ = writeln!(out, "<use xlink:href=\"#branch-{branch}\"/>");
        }
        out.push_str("</g>\n");
    }
    out.push_str("<g id=\"branches\">\n");
    for (branch_idx, branch) in list.iter().enumerate().rev() {
        write_branch(out, content, page, (branch_idx, branch));
    }
    out.push_str("</g>\n");
}

fn write_branch(
    out: &mut String,
    content: &Content<'_>,
    page: &Page,
    (branch_idx, branch): (usize, &Branch),
) {
    let (tree, scene) = (content.tree, content.scene);
    let (mut value, mut weighted_radius, mut length) = (0.0, 0.0, 0.0);
    for node in branch.nodes.clone() {
        let edge = tree.edge_length_mm(node);
        let parent = tree.parent(node).unwrap_or(node);
        let radius = |node: usize| tree.nodes()[node].radius_mm;
        value += edge * f64::from(content.coloring.ends[node].iter().sum::<f32>()) / 2.0;
        weighted_radius += edge * 0.5 * (radius(node) + radius(parent));
        length += edge;
    }
    let fill = hex(content.coloring.palette.at((value / length) as f32));
    let points: Vec<(DVec2, f64)> = branch
        .polyline()
        .map(|node| (page.px(scene.points_mm[node].truncate()), page.radius_px(scene.radii_mm[node])))
        .collect();
    let paint = match page.pen.style {
        Style::PseudoSurface => format!("d=\"{}\" fill=\"{fill}\"", outline(&points)),
        Style::Line => format!(
            "d=\"{}\" fill=\"none\" stroke=\"{fill}\" stroke-width=\"{:.2}\" stroke-linecap=\"round\" \
             stroke-linejoin=\"round\"",
            polyline(&points),
            page.pen.min_width_px
        ),
    };
    let parent = branch.parent.map_or_else(String::new, |parent| format!(" data-parent=\"{parent}\""));
    let _ = writeln!(
        out,
        "<path id=\"branch-{branch_idx}\" data-branch=\"{branch_idx}\"{parent} data-generation=\"{}\" \
         data-strahler=\"{}\" data-nodes=\"{} {}\" data-length-mm=\"{length:.6}\" data-radius-mm=\"{:.6}\" {paint}/>",
        branch.generation,
        branch.strahler,
        branch.nodes.start,
        branch.end(),
        weighted_radius / length,
    );
}

fn polyline(points: &[(DVec2, f64)]) -> String {
    let mut path = String::new();
    for (i, (point, _)) in points.iter().enumerate() {
        let _ = write!(path, "{}{:.2} {:.2}", if i == 0 { "M" } else { "L" }, point.x, point.y);
    }
    path
}

/// The closed outline of a chain of discs.
fn outline(points: &[(DVec2, f64)]) -> String {
    // Directions need points apart: drop those that a picture cannot tell from the one before.
    let mut chain: Vec<(DVec2, f64)> = Vec::with_capacity(points.len());
    for &(point, radius) in points {
        match chain.last() {
            Some(&(last, _)) if last.distance(point) < 1e-3 => {}
            _ => chain.push((point, radius)),
        }
    }
    let Some(&(first, radius)) = chain.first() else { return String::new() };
    if chain.len() == 1 {
        return format!(
            "M{0:.2} {1:.2}A{2:.2} {2:.2} 0 0 1 {3:.2} {1:.2}A{2:.2} {2:.2} 0 0 1 {0:.2} {1:.2}Z",
            first.x - radius,
            first.y,
            radius,
            first.x + radius
        );
    }
    let mut path = String::new();
    side(&mut path, &chain, 'M');
    let backwards: Vec<(DVec2, f64)> = chain.iter().rev().copied().collect();
    round_to_other_side(&mut path, &backwards);
    side(&mut path, &backwards, 'L');
    round_to_other_side(&mut path, &chain);
    path.push('Z');
    path
}

/// The left side of a chain, from its start to its end, in the direction of travel with y down.
fn side(path: &mut String, chain: &[(DVec2, f64)], first_command: char) {
    let left = |i: usize| {
        let along = (chain[i + 1].0 - chain[i].0).normalize();
        DVec2::new(along.y, -along.x)
    };
    let n_spans = chain.len() - 1;
    let start = chain[0].0 + chain[0].1 * left(0);
    if first_command == 'M' {
        let _ = write!(path, "M{:.2} {:.2}", start.x, start.y);
    }
    for (i, &(point, radius)) in chain.iter().enumerate().take(n_spans).skip(1) {
        let (before, after) = (left(i - 1), left(i));
        let turn = before.perp_dot(after);
        let (p, q) = (point + radius * before, point + radius * after);
        if turn.abs() < GENTLE && before.dot(after) > 0.0 {
            let corner = point + radius * (before + after).normalize();
            let _ = write!(path, "L{:.2} {:.2}", corner.x, corner.y);
        } else if turn > 0.0 {
            // The chain turns right, away from this side: round the corner.
            let _ =
                write!(path, "L{:.2} {:.2}A{radius:.2} {radius:.2} 0 0 1 {:.2} {:.2}", p.x, p.y, q.x, q.y);
        } else {
            let _ =
                write!(path, "L{:.2} {:.2}L{:.2} {:.2}L{:.2} {:.2}", p.x, p.y, point.x, point.y, q.x, q.y);
        }
    }
    let end = chain[n_spans].0 + chain[n_spans].1 * left(n_spans - 1);
    let _ = write!(path, "L{:.2} {:.2}", end.x, end.y);
}

/// From the end of one side round the disc to where the other side, along `next`, starts.
fn round_to_other_side(path: &mut String, next: &[(DVec2, f64)]) {
    let (point, radius) = next[0];
    let along = (next[1].0 - point).normalize();
    let to = point + radius * DVec2::new(along.y, -along.x);
    let _ = write!(path, "A{radius:.2} {radius:.2} 0 0 1 {:.2} {:.2}", to.x, to.y);
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
                escaped(text)
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

/// Text as XML: markup characters by their names, and without the control characters that XML 1.0 forbids.
pub(crate) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&apos;"),
            '\t' | '\n' | '\r' => out.push(' '),
            letter if letter.is_control() || matches!(letter, '\u{fffe}' | '\u{ffff}') => {}
            letter => out.push(letter),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_tube_is_two_sides_and_two_half_circles() {
        let path = outline(&[(DVec2::new(10.0, 20.0), 3.0), (DVec2::new(30.0, 20.0), 2.0)]);
        assert_eq!(
            path,
            "M10.00 17.00L30.00 18.00A2.00 2.00 0 0 1 30.00 22.00L10.00 23.00A3.00 3.00 0 0 1 10.00 17.00Z"
        );
    }

    #[test]
    fn bends_are_round_outside_and_pivot_inside() {
        let at = |x: f64, y: f64| (DVec2::new(x, y), 1.0);
        let path = outline(&[at(0.0, 0.0), at(10.0, 0.0), at(10.0, 10.0)]);
        assert_eq!(path.matches('A').count(), 3, "{path}");
        assert!(path.contains("L10.00 -1.00A1.00 1.00 0 0 1 11.00 0.00"), "{path}");
        assert!(path.contains("L9.00 0.00L10.00 0.00L10.00 1.00"), "{path}");
    }

    #[test]
    fn nothing_escapes_the_text() {
        assert_eq!(escaped("a<b>&\"'\u{1}\n"), "a&lt;b&gt;&amp;&quot;&apos; ");
    }
}
