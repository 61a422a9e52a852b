//! Two trees on one map as SVG.
//!
//! **Input** the sheet. **Output** for each panel one path for each run of edges of one row and one fate, then the marks.

use std::fmt::Write as _;

use espalier_model::Fate;
use glam::DVec2;

use super::{Artist, GHOST, Sheet};
use crate::outline::{outline, svg_data};
use crate::page::{Page, Pen};
use crate::palette::hex;
use crate::params::Style;
use crate::svg;

impl Artist<'_> {
    /// The document.
    pub(super) fn svg(&self, sheet: &Sheet, title: &str) -> String {
        let size = [self.params.width_px, sheet.height];
        let mut out = svg::begun(("juxtaposition", title), size, &self.colors);
        for panel in &sheet.panels {
            let page = Page { pen: Pen { style: sheet.style, ..panel.page.pen }, ..panel.page };
            self.write_tree(&mut out, panel.tree, &page);
        }
        svg::write_groups(&mut out, &sheet.groups);
        out.push_str("</svg>\n");
        out
    }

    /// A tree as one path for each run of edges of one row and one fate.
    fn write_tree(&self, out: &mut String, tree: usize, page: &Page) {
        let name = ["baseline", "follow-up"][tree];
        let _ =
            writeln!(out, "<g id=\"{name}-branches\" stroke-linecap=\"round\" stroke-linejoin=\"round\">");
        let mut runs = self.runs(tree);
        // Threads at the bottom, then thick over thin as in the raster.
        let width_mm = |run: &Run| {
            run.nodes[1..].iter().filter_map(|&node| self.radius_mm(tree, node)).fold(0.0, f64::max)
        };
        runs.sort_by(|a, b| a.is_there.cmp(&b.is_there).then(width_mm(a).total_cmp(&width_mm(b))));
        if page.pen.style != Style::Line {
            let rim = hex(self.colors.rim);
            let _ = writeln!(out, "<g stroke=\"{rim}\" stroke-opacity=\"0.75\" stroke-width=\"1.3\">");
            for (run_idx, _) in runs.iter().enumerate().filter(|(_, run)| run.is_there) {
                let _ = writeln!(out, "<use xlink:href=\"#{name}-{run_idx}\"/>");
            }
            out.push_str("</g>\n");
        }
        for (run_idx, run) in runs.iter().enumerate() {
            self.write_run(out, (tree, name, run_idx), run, page);
        }
        out.push_str("</g>\n");
    }

    fn runs(&self, tree: usize) -> Vec<Run> {
        let mut runs: Vec<Run> = Vec::new();
        for (node, parent) in self.found.shared.edges() {
            let is_there = self.has(tree, node, parent);
            let key = (self.found.nodes[node].row, self.found.nodes[node].fate, is_there);
            match runs.last_mut() {
                Some(run) if run.nodes.last() == Some(&parent) && run.key == key => run.nodes.push(node),
                _ => runs.push(Run { key, is_there, nodes: vec![parent, node] }),
            }
        }
        runs
    }

    fn write_run(
        &self,
        out: &mut String,
        (tree, name, run_idx): (usize, &str, usize),
        run: &Run,
        page: &Page,
    ) {
        let own = &run.nodes[1..];
        let mean = own.iter().map(|&node| self.coloring.ends[tree][node][1]).sum::<f32>() / own.len() as f32;
        let fill = hex(self.coloring.palette.at(mean));
        let center = |node: usize| page.px(self.scene.points_mm[node].truncate());
        let row = run.key.0.unwrap_or(0);
        let ids = format!(
            "id=\"{name}-{run_idx}\" data-row=\"{row}\" data-fate=\"{}\" data-present=\"{}\"",
            run.key.1.name(),
            run.is_there
        );
        if run.is_there && page.pen.style != Style::Line {
            let radius = |place: usize| {
                // At a fork the run begins with its own tube.
                let node = if place == 0 && self.found.nodes[run.nodes[0]].row != run.key.0 {
                    own[0]
                } else {
                    run.nodes[place]
                };
                page.radius_px(self.radius_mm(tree, node).unwrap_or(0.0))
            };
            let points: Vec<(DVec2, f64)> =
                run.nodes.iter().enumerate().map(|(place, &node)| (center(node), radius(place))).collect();
            let _ = writeln!(out, "<path {ids} d=\"{}Z\" fill=\"{fill}\"/>", svg_data(&outline(&points)));
            return;
        }
        let mut path = String::new();
        for (place, &node) in run.nodes.iter().enumerate() {
            let at = center(node);
            let _ = write!(path, "{}{:.2} {:.2}", if place == 0 { "M" } else { "L" }, at.x, at.y);
        }
        let width = page.pen.min_width_px * if run.is_there { 1.0 } else { GHOST };
        let _ = writeln!(
            out,
            "<path {ids} d=\"{path}\" fill=\"none\" stroke=\"{fill}\" stroke-width=\"{width:.2}\"/>"
        );
    }
}

/// Edges that follow on one another, of one row and fate, which a tree has or has not.
struct Run {
    key: (Option<usize>, Fate, bool),
    is_there: bool,
    /// From the node that it hangs from.
    nodes: Vec<usize>,
}
