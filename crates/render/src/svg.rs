//! The map as SVG: one named, editable path per branch.
//!
//! **Input** the scene on its page, colours, marks. **Output** SVG 1.1 text.
//! **Steps** 1. Each branch is one closed outline (see [`crate::outline`]). 2. A dark edge under all branches refers
//! to the same paths, so that an edited branch takes its edge along. 3. Marks follow in named groups; text stays text.
//! **Guarantees** coordinates in pixels with 2 decimals; titles and names are escaped; the picture is the same as
//! the PNG but for the light.
//! **Cost** O(nodes).

use std::fmt::Write as _;

use espalier_model::{Branch, Branches, Tree};
use glam::DVec2;

use crate::coloring::{Coloring, mean_radius_mm};
use crate::drawing::{Group, Mark};
use crate::outline::outline;
use crate::page::Page;
use crate::palette::{PageColors, Palette, hex};
use crate::params::Style;
use crate::scene::Scene;
use crate::text::Anchor;

/// Stops of a gradient in a colour bar.
const N_STOPS: usize = 17;
/// Generic fonts near the one of the PNG.
const FONTS: &str = "Ubuntu, 'Segoe UI', 'Helvetica Neue', Arial, sans-serif";

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
    /// What the ids of this tree begin with; empty unless the document shows several.
    pub prefix: &'a str,
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
    write_groups(&mut out, groups);
    out.push_str("</svg>\n");
    out
}

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

/// The branches, thick over thin as in the raster; of equals the parent over the starts of its children.
pub(crate) fn tree(out: &mut String, content: &Content<'_>, page: &Page, colors: &PageColors) {
    let prefix = content.prefix;
    let list = content.branches.list();
    if list.is_empty() {
        let center = page.px(content.scene.points_mm[0].truncate());
        let radius = page.radius_px(content.scene.radii_mm[0]);
        let fill = hex(content.coloring.palette.at(content.coloring.ends[0][0]));
        let _ = writeln!(
            out,
            "<circle id=\"{prefix}root\" cx=\"{:.2}\" cy=\"{:.2}\" r=\"{radius:.2}\" fill=\"{fill}\"/>",
            center.x, center.y
        );
        return;
    }
    let mut order: Vec<usize> = (0..list.len()).rev().collect();
    let radii: Vec<f64> = list.iter().map(|branch| mean_radius_mm(content.tree, branch)).collect();
    order.sort_by(|&a, &b| radii[a].total_cmp(&radii[b]));
    if page.pen.style == Style::PseudoSurface {
        let rim = hex(colors.rim);
        let _ = writeln!(
            out,
            "<g id=\"{prefix}edges\" stroke=\"{rim}\" stroke-opacity=\"0.75\" stroke-width=\"1.3\" stroke-linejoin=\"round\">"
        );
        for branch in &order {
            let _ = writeln!(out, "<use xlink:href=\"#{prefix}branch-{branch}\"/>");
        }
        out.push_str("</g>\n");
    }
    let _ = writeln!(out, "<g id=\"{prefix}branches\">");
    for &branch in &order {
        write_branch(out, content, page, (branch, &list[branch]));
    }
    out.push_str("</g>\n");
}

fn write_branch(
    out: &mut String,
    content: &Content<'_>,
    page: &Page,
    (branch_idx, branch): (usize, &Branch),
) {
    let (tree, scene, prefix) = (content.tree, content.scene, content.prefix);
    let (mut value, mut length) = (0.0, 0.0);
    for node in branch.nodes.clone() {
        let edge = tree.edge_length_mm(node);
        value += edge * f64::from(content.coloring.ends[node].iter().sum::<f32>()) / 2.0;
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
        "<path id=\"{prefix}branch-{branch_idx}\" data-branch=\"{branch_idx}\"{parent} data-generation=\"{}\" \
         data-strahler=\"{}\" data-nodes=\"{} {}\" data-length-mm=\"{length:.6}\" data-radius-mm=\"{:.6}\" {paint}/>",
        branch.generation,
        branch.strahler,
        branch.nodes.start,
        branch.end(),
        mean_radius_mm(tree, branch),
    );
}

fn polyline(points: &[(DVec2, f64)]) -> String {
    let mut path = String::new();
    for (i, (point, _)) in points.iter().enumerate() {
        let _ = write!(path, "{}{:.2} {:.2}", if i == 0 { "M" } else { "L" }, point.x, point.y);
    }
    path
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
    fn nothing_escapes_the_text() {
        assert_eq!(escaped("a<b>&\"'\u{1}\n"), "a&lt;b&gt;&amp;&quot;&apos; ");
    }
}
