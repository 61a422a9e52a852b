//! The map as SVG: one named, editable path per branch.
//!
//! **Input** the scene on its page, colours, marks. **Output** SVG 1.1 text.
//! **Steps** 1. Each branch is one closed outline (see [`crate::outline`]). 2. A dark edge under all branches refers
//! to the same paths, so that an edited branch takes its edge along. 3. Marks follow in named groups; text stays text.
//! **Guarantees** coordinates in pixels with 2 decimals; titles and names are escaped; the picture is the same as
//! the PNG but for the light. A scan on the map is an image, and the branches over it have no colour.
//! **Cost** O(nodes).

use std::fmt::Write as _;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use espalier_model::xml::escape;
use espalier_model::{Branch, Branches, Tree};
use glam::DVec2;

use crate::coloring::{Coloring, mean_radius_mm};
use crate::drawing::{Group, Mark};
use crate::outline::{outline, polyline, svg_data};
use crate::page::Page;
use crate::palette::{PageColors, Palette, Rgb, hex};
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

/// Writes the document. `scan` is the whole page without its marks as PNG, for a page that shows a scan.
pub(crate) fn svg(
    content: &Content<'_>,
    (page, groups): (&Page, &[Group]),
    scan: Option<&[u8]>,
    colors: &PageColors,
) -> String {
    let (width, height) = (page.width, page.height);
    let mut out = String::new();
    // Writing to a String cannot fail, so the results of write! are dropped throughout.
    let _ = writeln!(
        out,
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" \
         xmlns:xlink=\"http://www.w3.org/1999/xlink\" version=\"1.1\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" data-format=\"espalier-planar-svg\" data-version=\"1\" \
         data-mm-per-px=\"{:.9e}\" data-origin-px=\"{:.2} {:.2}\" data-turn-deg=\"{}\">\n<title>{}</title>",
        1.0 / page.px_per_mm,
        page.origin_px.x,
        page.origin_px.y,
        content.scene.turn_deg,
        escape(content.title)
    );
    let _ = writeln!(
        out,
        "<rect id=\"background\" width=\"{width}\" height=\"{height}\" fill=\"{}\"/>",
        hex(colors.background)
    );
    if let Some(png) = scan {
        let _ = writeln!(
            out,
            "<image id=\"scan\" width=\"{width}\" height=\"{height}\" \
             xlink:href=\"data:image/png;base64,{}\"/>",
            BASE64_STANDARD.encode(png)
        );
    }
    tree(&mut out, content, page, colors);
    write_groups(&mut out, groups);
    out.push_str("</svg>\n");
    out
}

/// A plot as a document of its own, `espalier-KIND-svg`.
pub(crate) fn plot(
    kind: &str,
    title: &str,
    groups: &[Group],
    ([width, height], colors): ([u32; 2], &PageColors),
) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" version=\"1.1\" \
         width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
         data-format=\"espalier-{kind}-svg\" data-version=\"1\">\n<title>{}</title>\n\
         <rect id=\"background\" width=\"{width}\" height=\"{height}\" fill=\"{}\"/>",
        escape(title),
        hex(colors.background)
    );
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

/// The branches, each a path, over their dark edges.
pub(crate) fn tree(out: &mut String, content: &Content<'_>, page: &Page, colors: &PageColors) {
    let prefix = content.prefix;
    let list = content.branches.list();
    if list.is_empty() {
        let center = page.px(content.scene.points_mm[0].truncate());
        let radius = page.radius_px(content.scene.radii_mm[0]);
        let fill = hex(content.coloring.palette.at(content.coloring.ends[0][0]));
        let opacity = if page.pen.style == Style::Volume { " fill-opacity=\"0\"" } else { "" };
        let _ = writeln!(
            out,
            "<circle id=\"{prefix}root\" cx=\"{:.2}\" cy=\"{:.2}\" r=\"{radius:.2}\" fill=\"{fill}\"{opacity}/>",
            center.x, center.y
        );
        return;
    }
    let order = drawing_order(content);
    if !matches!(page.pen.style, Style::Line | Style::Volume) {
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

/// A branch in pixels, and its one colour.
pub(crate) struct Ribbon {
    /// The middle and the radius at each node.
    pub discs: Vec<(DVec2, f64)>,
    /// The mean colour over its length.
    pub color: Rgb,
}

impl Ribbon {
    pub(crate) fn of(content: &Content<'_>, page: &Page, branch: &Branch) -> Self {
        let Content { tree, scene, coloring, .. } = *content;
        let (mut value, mut length) = (0.0, 0.0);
        for node in branch.nodes.clone() {
            let edge = tree.edge_length_mm(node);
            value += edge * f64::from(coloring.ends[node].iter().sum::<f32>()) / 2.0;
            length += edge;
        }
        let disc =
            |node: usize| (page.px(scene.points_mm[node].truncate()), page.radius_px(scene.radii_mm[node]));
        Self {
            discs: branch.polyline().map(disc).collect(),
            color: coloring.palette.at((value / length) as f32),
        }
    }
}

/// The branches in the order in which they are drawn: thick over thin as in the raster; of equals the parent over the
/// starts of its children.
pub(crate) fn drawing_order(content: &Content<'_>) -> Vec<usize> {
    let list = content.branches.list();
    let mut order: Vec<usize> = (0..list.len()).rev().collect();
    let radii: Vec<f64> = list.iter().map(|branch| mean_radius_mm(content.tree, branch)).collect();
    order.sort_by(|&a, &b| radii[a].total_cmp(&radii[b]));
    order
}

fn write_branch(
    out: &mut String,
    content: &Content<'_>,
    page: &Page,
    (branch_idx, branch): (usize, &Branch),
) {
    let (tree, prefix) = (content.tree, content.prefix);
    let Ribbon { discs, color } = Ribbon::of(content, page, branch);
    let fill = hex(color);
    let paint = match page.pen.style {
        Style::PseudoSurface | Style::Ribbon => {
            format!("d=\"{}Z\" fill=\"{fill}\"", svg_data(&outline(&discs)))
        }
        // Under the pointer and the editor, but the scan is seen.
        Style::Volume => format!("d=\"{}Z\" fill=\"#000\" fill-opacity=\"0\"", svg_data(&outline(&discs))),
        Style::Line => format!(
            "d=\"{}\" fill=\"none\" stroke=\"{fill}\" stroke-width=\"{:.2}\" stroke-linecap=\"round\" \
             stroke-linejoin=\"round\"",
            svg_data(&polyline(&discs)),
            page.pen.min_width_px
        ),
    };
    let parent = branch.parent.map_or_else(String::new, |parent| format!(" data-parent=\"{parent}\""));
    let _ = writeln!(
        out,
        "<path id=\"{prefix}branch-{branch_idx}\" data-branch=\"{branch_idx}\"{parent} data-generation=\"{}\" \
         data-strahler=\"{}\" data-nodes=\"{} {}\" data-length-mm=\"{:.6}\" data-radius-mm=\"{:.6}\" {paint}/>",
        branch.generation,
        branch.strahler,
        branch.nodes.start,
        branch.end(),
        content.branches.length_mm(tree, branch_idx),
        mean_radius_mm(tree, branch),
    );
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
