//! Two trees on one shared map, side by side at one scale and pose, differences coloured.
//!
//! **Input** the shared tree with what is known of its nodes, its places in the plane. **Output** PNG and SVG.
//! **Files** `colors`: what has which colour; `document`: the SVG.
//! **Steps** 1. The map is drawn twice, beside itself or below, whichever is larger: once with the radii of the baseline,
//! once with those of the follow-up. 2. The baseline is grey; what it has alone has the colour of loss. In the follow-up
//! what both have is coloured by its change, on a diverging scale whose middle is no change; what is new has a colour of
//! its own. 3. What a tree has not is a thin line in its panel. 4. Key and scale bar stand at the right.
//! **Guarantees** the same place of both panels is the same place of the shared map.
//! **Source** section 4.1 and figure 8 of [Hu2022]; the colours are ours.
//! **Cost** that of two small pictures.

mod colors;
mod document;

use colors::Colors;
use espalier_model::{Embedding, Fate, Juxtaposition, SharedNode};
use glam::DVec2;

use crate::cone::{Ball, Cone, Joint};
use crate::drawing::{Group, Mark};
use crate::furniture::{self, Heading};
use crate::kinship::Kinship;
use crate::page::{MAX_PIXELS, Page, Pen};
use crate::paint::Canvas;
use crate::palette::PageColors;
use crate::params::{Params, Style};
use crate::raster::{self, Drawn, Job, Raster};
use crate::room::Grid;
use crate::scene::Scene;
use crate::sheet::MAX_LAYERS;
use crate::side_by_side::SideBySide;
use crate::text::{Anchor, Face};
use crate::{Error, heading, root_mark, unit};

/// In layout units: font sizes of panel names and of the key, space between panels, around a tree, for the key.
const TITLE: f64 = 1.6;
const SMALL: f64 = 1.2;
const GAP: f64 = 3.0;
const RIM: f64 = 2.2;
const KEY: f64 = 15.0;
/// Line height over font size.
const LEADING: f64 = 1.5;
/// Height of all panels over the width of the page, at most.
const MOST_HEIGHT: f64 = 0.85;
/// By what factor panels below each other must be larger than beside each other: a page higher than wide is scrolled.
const LEAST_GAIN_BELOW: f64 = 1.5;
/// Width of what a tree has not, as a share of the least width of a branch.
const GHOST: f64 = 0.75;
/// What the colours of the follow-up mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ChangeOf {
    /// The radius at each place.
    #[default]
    Radius,
    /// The length of each branch.
    Length,
}

/// Draws two trees on their shared map; `embedding` is that of the shared tree, `names` are those of the panels.
///
/// # Errors
/// [`Error`] if a parameter is out of range, the embedding is another tree's, a number cannot be drawn, or the figure
/// would be over 2²⁷ pixels.
pub fn juxtaposed(
    (found, embedding): (&Juxtaposition, &Embedding),
    change: ChangeOf,
    names: [&str; 2],
    params: &Params,
) -> Result<SideBySide, Error> {
    params.validate()?;
    let params = &params.without_scan();
    let (n_entries, n_nodes) = (embedding.positions_mm.len(), found.shared.n_nodes());
    if n_entries != n_nodes {
        return Err(Error::Mismatch { what: "positions", n_entries, n_nodes });
    }
    let scene = Scene::flat(&found.shared, &embedding.positions_mm, params.width_scale)?;
    let colors = PageColors::of(params.theme);
    let coloring = Colors::new(found, change);
    let artist = Artist { found, params, scene, coloring, colors, face: Face::built_in()? };
    let sheet = artist.lay_out(&heading_of(found, embedding, params), names)?;
    let (width, height) = (params.width_px, sheet.height);
    let mut canvas = Canvas::new([width, height], colors.background)?;
    for panel in &sheet.panels {
        artist.draw(panel, sheet.style, &mut canvas);
    }
    canvas.mark(&sheet.groups, &artist.face);
    let png = canvas.png();
    let title = params.title.as_deref().unwrap_or("juxtaposition");
    Ok(SideBySide { png, svg: artist.svg(&sheet, title) })
}

fn heading_of(found: &Juxtaposition, embedding: &Embedding, params: &Params) -> Heading {
    let counted = |fate: Fate| {
        let n = found.of_fate(fate).count();
        let length_mm = found.length_mm(fate);
        let unit = unit::LengthUnit::choose(params.unit, 0.1 * length_mm);
        format!("{n} {} ({} {})", fate.name(), unit::text(length_mm / unit.mm, 3), unit.sign)
    };
    let verdict = vec![
        "baseline and follow-up on one shared map".to_owned(),
        heading::verdict(embedding),
        format!("branches: {}, {}, {}", counted(Fate::Matched), counted(Fate::Lost), counted(Fate::New)),
    ];
    let alignment = &found.alignment;
    let mut facts = Vec::new();
    if alignment.n_points > 0 {
        let moved = if alignment.scale == 1.0 { "rigidly" } else { "by a similarity" };
        let unit = unit::LengthUnit::choose(params.unit, alignment.residual_max_mm.max(1e-9));
        let of_unit = |value: f64| format!("{} {}", unit::text(value / unit.mm, 2), unit.sign);
        facts.push(format!(
            "follow-up moved {moved} onto the baseline (turned by {:.1}°): matched forks are {} apart on average, {} at most",
            alignment.angle_deg(),
            of_unit(alignment.residual_mean_mm),
            of_unit(alignment.residual_max_mm)
        ));
    }
    facts.push("what both have is drawn at the baseline's lengths and bends".to_owned());
    facts.push("thin lines: what the other one has".to_owned());
    Heading { title: params.title.clone(), verdict, facts }
}

/// One of the two trees in its place.
struct Panel {
    /// 0 for the baseline, 1 for the follow-up.
    tree: usize,
    page: Page,
}

struct Sheet {
    panels: [Panel; 2],
    groups: Vec<Group>,
    height: u32,
    style: Style,
}

struct Artist<'a> {
    found: &'a Juxtaposition,
    params: &'a Params,
    scene: Scene,
    coloring: Colors,
    colors: PageColors,
    face: Face,
}

impl Artist<'_> {
    fn lay_out(&self, said: &Heading, names: [&str; 2]) -> Result<Sheet, Error> {
        let (unit, margin) = (Page::unit_px(self.params.width_px), Page::margin_px(self.params.width_px));
        let width = f64::from(self.params.width_px);
        let (group, heading_px) = furniture::heading(&self.face, said, self.params.width_px, &self.colors);
        let key_px = furniture::key_size(&self.face, &self.coloring.key, self.params.width_px);
        let room = width - 2.0 * margin - KEY.max(key_px.x / unit) * unit - GAP * unit;
        let (low_mm, high_mm) = self.scene.bounds_mm();
        let size_mm = (high_mm - low_mm).max(DVec2::splat(1e-12));
        let rim = 2.0 * RIM * unit;
        let title_px = LEADING * TITLE * unit;
        let scale = |wide: f64, high: f64| {
            let inner = DVec2::new(wide - rim, high - rim).max(DVec2::splat(unit));
            (inner / size_mm).min_element()
        };
        let beside = scale(0.5 * (room - GAP * unit), MOST_HEIGHT * width - title_px);
        let below = scale(room, 0.5 * (MOST_HEIGHT * width - GAP * unit) - title_px);
        let is_beside = beside * LEAST_GAIN_BELOW >= below;
        let px_per_mm = if is_beside { beside } else { below };
        let panel_px = size_mm * px_per_mm + rim;
        let top = margin + heading_px + unit + title_px;
        let step = if is_beside {
            DVec2::new(panel_px.x + GAP * unit, 0.0)
        } else {
            DVec2::new(0.0, panel_px.y + title_px + GAP * unit)
        };
        let panel = |tree: usize| {
            let low = (DVec2::new(margin, top) + step * tree as f64).floor();
            let center_mm = 0.5 * (low_mm + high_mm);
            let center_px = low + 0.5 * panel_px;
            let origin_px = center_px - px_per_mm * DVec2::new(center_mm.x, -center_mm.y);
            let pen = Pen { min_width_px: self.params.min_width_px, style: self.params.style };
            let area = [low, low + panel_px];
            let (width, height) = (self.params.width_px, 0);
            Panel {
                tree,
                page: Page { width, height, unit_px: unit, px_per_mm, origin_px, area, key_at: low, pen },
            }
        };
        let panels = [panel(0), panel(1)];
        let key_at = DVec2::new(panels[1].page.area[1].x + GAP * unit, top);
        let mut groups = vec![group];
        let swatches_at = key_at + DVec2::new(0.0, key_px.y + 2.0 * unit);
        let key_page = Page { key_at, ..panels[1].page };
        groups.extend(furniture::key(&key_page, &self.coloring.key, self.params, &self.colors));
        let (swatches, bottom) = self.swatches(swatches_at, unit);
        groups.push(swatches);
        let lowest = panels[1].page.area[1].y.max(bottom);
        let (width, height) = (self.params.width_px, (lowest + margin) as u32);
        if u64::from(width) * u64::from(height) > MAX_PIXELS {
            return Err(Error::TooLarge { width, height, limit: MAX_PIXELS });
        }
        let names = [0, 1].map(|tree: usize| self.name_of(&panels[tree], names[tree], unit));
        let mut room = Grid::new([width, height], unit);
        room.take_marks(&groups, &self.face);
        room.take_marks(&names, &self.face);
        for panel in &panels {
            room.take_branches(&panel.page, &self.found.shared, &self.scene);
        }
        for (panel, mut group) in panels.iter().zip(names) {
            let subject = (&self.found.shared, &self.scene);
            let root = root_mark::root_mark((&panel.page, &mut room), subject, (&self.face, &self.colors));
            group.marks.extend(root.marks);
            groups.push(group);
        }
        let style = self.style(&panels);
        Ok(Sheet { panels, groups, height, style })
    }

    /// Lines where radii would cover a panel several times over.
    fn style(&self, panels: &[Panel; 2]) -> Style {
        let is_thick = |panel: &Panel| {
            let page = panel.page.panel();
            let drawn = self.edges(panel.tree, &page, Style::PseudoSurface);
            raster::layers(page.size(), &drawn) > MAX_LAYERS
        };
        if panels.iter().any(is_thick) { Style::Line } else { self.params.style }
    }

    /// The name of a panel.
    fn name_of(&self, panel: &Panel, name: &str, unit: f64) -> Group {
        let low = panel.page.area[0];
        let at = DVec2::new(low.x, low.y - 0.4 * TITLE * unit);
        let marks = vec![self.text(at, TITLE * unit, true, name)];
        Group { name: if panel.tree == 0 { "baseline" } else { "follow-up" }, marks }
    }

    /// What the colours beside the scale mean, and where that ends.
    fn swatches(&self, at: DVec2, unit: f64) -> (Group, f64) {
        let mut marks = Vec::new();
        let mut middle = at;
        let coloring = &self.coloring;
        for (color, text) in [
            (coloring.lost, "lost: baseline only"),
            (coloring.new, "new: follow-up only"),
            (coloring.neither, "baseline, or unknown"),
        ] {
            let (from, to) = (middle, middle + DVec2::new(2.4 * unit, 0.0));
            marks.push(Mark::Line { from, to, width_px: 0.9 * unit, color });
            let at = to + DVec2::new(0.7 * unit, 0.36 * SMALL * unit);
            marks.push(self.text(at, SMALL * unit, false, text));
            middle.y += LEADING * SMALL * unit;
        }
        (Group { name: "fates", marks }, middle.y)
    }

    fn text(&self, at: DVec2, size_px: f64, is_strong: bool, text: &str) -> Mark {
        let (anchor, color) = (Anchor::Start, self.colors.ink);
        Mark::Text { at, size_px, anchor, is_strong, color, text: text.to_owned() }
    }

    /// The radius of a node's tube in a tree, in mm; `None` where it has none.
    fn radius_mm(&self, tree: usize, node: usize) -> Option<f64> {
        let SharedNode { baseline_radius_mm, followup_radius_mm, .. } = self.found.nodes[node];
        let radius_mm = if tree == 0 { baseline_radius_mm } else { followup_radius_mm };
        radius_mm.map(|radius_mm| radius_mm * self.params.width_scale)
    }

    /// Whether a tree has the edge of a node.
    fn has(&self, tree: usize, node: usize, parent: usize) -> bool {
        self.radius_mm(tree, node).is_some() && self.radius_mm(tree, parent).is_some()
    }

    /// The edges as cones; those that a tree has not as threads.
    fn edges(&self, tree: usize, page: &Page, style: Style) -> Vec<Drawn> {
        let shared = &self.found.shared;
        let page = Page { pen: Pen { style, ..page.pen }, ..*page };
        let kinship = self.kinship(&page);
        let center = |node: usize| page.px(self.scene.points_mm[node].truncate()).extend(0.0);
        let ball = |node: usize, is_there: bool| {
            let own = self.radius_mm(tree, node).filter(|_| is_there);
            let thread = 0.5 * GHOST * page.pen.min_width_px;
            Ball { center: center(node), radius: own.map_or(thread, |radius_mm| page.radius_px(radius_mm)) }
        };
        let drawn = |node: usize, parent: usize| {
            let is_there = self.has(tree, node, parent);
            // Only what is drawn alike goes on without a joint.
            let before = shared.parent(parent).filter(|&before| {
                shared.children(parent).len() == 1 && self.has(tree, parent, before) == is_there
            });
            let after = match shared.children(node) {
                &[after] if self.has(tree, after, node) == is_there => Some(after),
                _ => None,
            };
            let joint = |of: Option<usize>| of.map_or(Joint::End, |node| Joint::Chain(ball(node, is_there)));
            let (mut from, to) = (ball(parent, is_there), ball(node, is_there));
            if self.found.nodes[node].fate != self.found.nodes[parent].fate {
                // What is lost or new must not colour the fork that stays.
                from.radius = from.radius.min(to.radius);
            }
            Drawn {
                node: node as u32,
                cone: Cone::new(from, to, [joint(before), joint(after)]),
                values: self.coloring.ends[tree][node],
                arc_px: [kinship.arc_px[parent], kinship.arc_px[node]],
            }
        };
        if shared.n_nodes() == 1 {
            let only = ball(0, true);
            let values = self.coloring.ends[tree][0];
            return vec![Drawn {
                node: 0,
                cone: Cone::new(only, only, [Joint::End; 2]),
                values,
                arc_px: [0.0; 2],
            }];
        }
        shared.edges().map(|(node, parent)| drawn(node, parent)).collect()
    }

    fn kinship(&self, page: &Page) -> Kinship {
        Kinship::new(&self.found.shared, &self.found.shared.branches(), &self.scene, page.px_per_mm)
    }

    fn draw(&self, panel: &Panel, style: Style, canvas: &mut Canvas) {
        let page = panel.page.panel();
        let drawn = self.edges(panel.tree, &page, style);
        let kinship = self.kinship(&page);
        let raster = Raster::new(Job {
            size: page.size(),
            drawn: &drawn,
            kinship: &kinship,
            palette: &self.coloring.palette,
            colors: self.colors,
            style,
            has_depth: false,
        });
        canvas.surface(&raster, [panel.page.area[0].x as usize, panel.page.area[0].y as usize], |_, _| ());
    }
}
