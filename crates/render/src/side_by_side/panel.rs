//! What stands around the tree of a panel: title, notes, letters, the root, rings at crossings.
//!
//! **Input** a panel in its place, its row of the table. **Output** its marks.
//! **Steps** what is best among the section's layouts without crossings is set bold, by what its note reads. Rings that
//! would lie upon each other are thinned out.
//! **Cost** O(crossings · log crossings + methods).

use std::collections::BTreeMap;

use espalier_model::{MethodRow, Tree};
use glam::DVec2;

use super::{Artist, Frame, LEADING, N_NOTES, NOTE, RIM, Section, TITLE, strong};
use crate::drawing::{Group, Mark};
use crate::page::Page;
use crate::{furniture, heading, root_mark};

/// The letters to the left and right of a tree need this much beside its rim, in layout units.
pub(super) const SIDE: f64 = 3.3;
/// From this many on, the rings of crossings are smaller, so as not to hide the tree.
const MANY_CROSSINGS: usize = 40;

impl Artist<'_> {
    /// Title, notes, root and crossings of a panel.
    pub(super) fn panel_marks(&self, section: &Section<'_>, frame: &Frame<'_>, panel_idx: usize) -> Group {
        let unit = self.unit_px();
        let [low, high] = frame.page.area;
        let mut marks = Vec::from(root_mark::ring(&frame.page, &frame.scene, &self.colors));
        let panel = panel_idx.checked_sub(1).map(|idx| &section.panels[idx]);
        if let Some(panel) = panel {
            let (radius, width) =
                if panel.crossings.len() < MANY_CROSSINGS { (0.6, 0.2) } else { (0.4, 0.13) };
            let points = panel
                .crossings
                .iter()
                .map(|&pair| frame.page.px(crossing_point(frame.tree, panel.positions_mm, pair)));
            marks.extend(apart(points, 0.8 * radius * unit).into_iter().map(|center| Mark::Ring {
                center,
                radius_px: radius * unit,
                width_px: width * unit,
                color: self.colors.alarm,
            }));
        } else {
            let view = section.view;
            let axes = [view.up.cross(view.towards_camera), view.up];
            let around = self.around_tree(frame);
            let compass = furniture::compass(&around, axes, section.compass, &self.colors);
            marks.extend(compass.into_iter().flat_map(|group| group.marks));
        }
        let (title, notes) = match panel {
            Some(panel) => {
                let chosen = if panel.is_chosen { "  (the map)" } else { "" };
                let title = format!("{}{}{chosen}", panel.row.method, other_targets(section, panel.row));
                (title, notes(section, panel.row))
            }
            None => (
                "in space, from the global view".to_owned(),
                heading::size_of(frame.tree, &frame.branches, self.params)
                    .into_iter()
                    .map(|text| (text, false))
                    .collect(),
            ),
        };
        let at = DVec2::new(low.x, low.y - 0.45 * TITLE * unit);
        marks.push(strong(self.text(at, TITLE, self.colors.ink, &title)));
        for (line, (text, is_best)) in notes.into_iter().take(N_NOTES).enumerate() {
            let at = DVec2::new(low.x, high.y + (LEADING * (line as f64 + 0.9) * NOTE) * unit);
            let color = if is_best { self.colors.ink } else { self.colors.soft };
            let mark = self.text(at, NOTE, color, &text);
            marks.push(if is_best { strong(mark) } else { mark });
        }
        Group { name: "panel", marks }
    }

    /// The panel's page with its area drawn close around the tree.
    fn around_tree(&self, frame: &Frame<'_>) -> Page {
        let (low_mm, high_mm) = frame.scene.bounds_mm();
        let rim = DVec2::splat(RIM * self.unit_px());
        let low = frame.page.px(DVec2::new(low_mm.x, high_mm.y)) - rim;
        let high = frame.page.px(DVec2::new(high_mm.x, low_mm.y)) + rim;
        // Letters to the left and right need more room than those above and below.
        let side = DVec2::new(SIDE * self.unit_px(), 0.0);
        let [panel_low, panel_high] = frame.page.area;
        Page { area: [(low - side).max(panel_low), (high + side).min(panel_high)], ..frame.page }
    }
}

/// What tells a method that ran twice apart: the targets of its row, where they are not the embedding's.
fn other_targets(section: &Section<'_>, row: &MethodRow) -> String {
    let chosen = section.panels.iter().find(|panel| panel.is_chosen).map(|panel| panel.row.targets);
    let is_other = chosen.is_some_and(|chosen| chosen != row.targets);
    if is_other { format!(", targets {}", row.targets.name()) } else { String::new() }
}

/// What is said below a layout, each with whether it is the best of its section.
fn notes(section: &Section<'_>, row: &MethodRow) -> Vec<(String, bool)> {
    // A layout may be scored against other targets than the embedding.
    let kind = section.panels.iter().find(|panel| panel.is_chosen).map(|panel| panel.row.targets);
    let compares = |row: &&MethodRow| row.crossings == 0 && kind.is_none_or(|kind| kind == row.targets);
    let planar = || section.panels.iter().map(|panel| panel.row).filter(compares);
    // What reads alike is equally good.
    let note = |of: &dyn Fn(&MethodRow) -> f64, say: &dyn Fn(f64) -> String, rest: String| {
        let least = planar().map(of).fold(f64::INFINITY, f64::min);
        let said = say(of(row));
        let is_best = compares(&row) && said == say(least);
        (format!("{said}{rest}"), is_best)
    };
    let losses = &row.losses;
    let crossings = match row.crossings {
        0 => note(
            &|row| row.energy.total(),
            &|energy| format!("no crossings, energy {}", crate::unit::text(energy, 3)),
            String::new(),
        ),
        1 => ("1 crossing".to_owned(), false),
        n => (format!("{n} crossings"), false),
    };
    vec![
        crossings,
        note(
            &|row| row.losses.angle3d_error_mean_deg,
            &|mean| format!("angles off by {}", heading::degrees(mean)),
            format!(", max {}", heading::degrees(losses.angle3d_error_max_deg)),
        ),
        note(
            &|row| row.losses.length_loss_mean,
            &|mean| format!("lengths off by {}", heading::percent(mean)),
            format!(", max {}", heading::percent(losses.length_loss_max)),
        ),
        note(&|row| row.losses.stress, &|stress| format!("stress {stress:.3}"), String::new()),
        // The largest is the best.
        note(
            &|row| -row.losses.clearance_min_edges,
            &|clearance| format!("clearance {:.3} edges", -clearance),
            String::new(),
        ),
    ]
}

/// Those of the points, the first first, that are not nearer than `least_px` to one taken before: rings upon rings
/// would hide the tree. Cells as wide as that hold at most four taken points.
fn apart(points: impl Iterator<Item = DVec2>, least_px: f64) -> Vec<DVec2> {
    let mut taken: BTreeMap<[i64; 2], Vec<DVec2>> = BTreeMap::new();
    let mut list = Vec::new();
    for point in points {
        let cell = (point / least_px).floor().clamp(DVec2::splat(-1e9), DVec2::splat(1e9));
        let [column, row] = [cell.x as i64, cell.y as i64];
        let around = [-1, 0, 1].map(|step| taken.range([column + step, row - 1]..=[column + step, row + 1]));
        let near = around.into_iter().flatten().flat_map(|(_, points)| points);
        if near.into_iter().all(|other| other.distance_squared(point) >= least_px * least_px) {
            taken.entry([column, row]).or_default().push(point);
            list.push(point);
        }
    }
    list
}

/// Where two edges cross; the middle between their midpoints where they are parallel.
fn crossing_point(tree: &Tree, positions: &[DVec2], (a, b): (usize, usize)) -> DVec2 {
    let ends = |node: usize| (positions[tree.parent(node).unwrap_or(0)], positions[node]);
    let ((a0, a1), (b0, b1)) = (ends(a), ends(b));
    let (along_a, along_b) = (a1 - a0, b1 - b0);
    let across = along_a.perp_dot(along_b);
    if across.abs() <= 1e-12 * along_a.length() * along_b.length() {
        return 0.25 * (a0 + a1 + b0 + b1);
    }
    a0 + along_a * ((b0 - a0).perp_dot(along_b) / across).clamp(0.0, 1.0)
}
