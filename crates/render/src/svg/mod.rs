//! The map as SVG: one named, editable path per branch.
//!
//! **Input** the scene on its page, colours, marks. **Output** SVG 1.1 text.
//! **Steps** 1. Each branch is one closed outline (see [`crate::outline`]). 2. A dark edge under all branches refers
//! to the same paths, so that an edited branch takes its edge along. 3. Marks follow in named groups; text stays text.
//! **Guarantees** coordinates in pixels with 2 decimals; titles and names are escaped; the picture is the same as
//! the PNG but for the light. A scan on the map is an image, and the branches over it have no colour.
//! **Cost** O(nodes).

mod marks;

use std::fmt::Write as _;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use espalier_model::xml::escape;
use espalier_model::{Branch, Branches, Tree};
use glam::DVec2;
pub(crate) use marks::write_groups;

use crate::coloring::{Coloring, mean_radius_mm};
use crate::drawing::Group;
use crate::outline::{outline, polyline, svg_data};
use crate::page::Page;
use crate::palette::{PageColors, Rgb, hex};
use crate::params::Style;
use crate::scene::Scene;

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

/// What a figure of several panels shows in one of them.
pub(crate) enum Item<'a> {
    /// A tree, as paths.
    Tree(Content<'a>, &'a Page),
    /// A picture that fills the panel's area, as PNG, under a name.
    Picture(&'static str, &'a [u8], &'a Page),
}

/// A figure of several panels as a document of its own, `espalier-KIND-svg`. Ids of branches begin with the panel's prefix.
pub(crate) fn figure(
    (kind, title): (&str, &str),
    (items, groups): (&[Item<'_>], &[Group]),
    (size, colors): ([u32; 2], &PageColors),
) -> String {
    let mut out = begun((kind, title), size, colors);
    for item in items {
        match item {
            Item::Tree(content, page) => tree(&mut out, content, page, colors),
            Item::Picture(id, png, page) => {
                let (low, [width, height]) = (page.area[0], page.panel().size());
                let _ = writeln!(
                    out,
                    "<image id=\"{id}\" x=\"{}\" y=\"{}\" width=\"{width}\" height=\"{height}\" \
                     xlink:href=\"data:image/png;base64,{}\"/>",
                    low.x,
                    low.y,
                    BASE64_STANDARD.encode(png)
                );
            }
        }
    }
    write_groups(&mut out, groups);
    out.push_str("</svg>\n");
    out
}

/// A plot as a document of its own, `espalier-KIND-svg`.
pub(crate) fn plot(
    kind: &str,
    title: &str,
    groups: &[Group],
    (size, colors): ([u32; 2], &PageColors),
) -> String {
    figure((kind, title), (&[], groups), (size, colors))
}

/// The first lines of a document `espalier-KIND-svg`: its size, title and paper.
pub(crate) fn begun((kind, title): (&str, &str), [width, height]: [u32; 2], colors: &PageColors) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" \
         xmlns:xlink=\"http://www.w3.org/1999/xlink\" version=\"1.1\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" data-format=\"espalier-{kind}-svg\" data-version=\"1\">\n\
         <title>{}</title>\n<rect id=\"background\" width=\"{width}\" height=\"{height}\" fill=\"{}\"/>\n",
        escape(title),
        hex(colors.background)
    )
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
