//! The panels in their places, and what is said of them.
//!
//! **Input** the subject, its colours. **Output** a [`Sheet`].
//! **Steps** 1. The panels beside or below each other, whichever draws them larger, at one scale. 2. Key, titles, letters.
//! 3. Numbers of branches where there is room. Tubes and map become lines if their radii would cover a panel too often.

use glam::DVec2;

use super::cast::Surface;
use super::{Artist, Frame, Kind, LEADING, Sheet, numbers};
use crate::drawing::Group;
use crate::furniture::{self, Heading};
use crate::kinship::Kinship;
use crate::page::{Page, Pen};
use crate::params::{ColorBy, Compass, SpaceView, Style};
use crate::raster;
use crate::scene::Scene;
use crate::sheet::MAX_LAYERS;
use crate::{Error, heading, root_mark};

/// Sizes in layout units: the font size of titles, space between panels, space around a tree with its letters, the least
/// room of all trees together.
const TITLE: f64 = 1.5;
const GAP: f64 = 1.6;
const RIM: f64 = 3.4;
const LEAST_ROOM: f64 = 8.0;
/// A tree smaller than this has no scale of its own, mm.
const SMALLEST_MM: f64 = 1e-12;
/// Height of the panels over the width of the page.
const MOST_HEIGHT: f64 = 0.7;
/// Width of tubes and of the centreline at least, as shares of `min_width_px`.
const TUBE_PEN: f64 = 0.8;
const LINE_PEN: f64 = 1.3;

impl<'a> Artist<'a> {
    /// Everything in its place.
    pub(super) fn lay_out(&self, flat: Scene) -> Result<Sheet<'a>, Error> {
        let tree = self.subject.tree;
        let seen = Scene::seen(tree, &self.view, self.params.width_scale)?;
        let surface = self.subject.organ.and_then(|organ| Surface::new(organ, &self.view));
        let in_space = self.bounds_mm(&seen, surface.as_ref());
        let flat_mm = flat.bounds_mm();
        let mut panels = vec![(Kind::Line, seen.clone(), in_space), (Kind::Map, flat, flat_mm.into())];
        if surface.is_some() {
            panels.insert(0, (Kind::Surface, seen, in_space));
        } else if !self.is_fine(in_space) {
            panels.insert(0, (Kind::Tubes, seen, in_space));
        }
        let (group, heading_px) =
            furniture::heading(&self.face, &self.said(), self.params.width_px, &self.colors);
        let mut sheet = Sheet { frames: Vec::new(), surface, groups: vec![group], size: [0; 2] };
        let end_px = self.tile(panels, Page::margin_px(self.params.width_px) + heading_px, &mut sheet);
        let Some(first) = sheet.frames.first() else { return Ok(sheet) };
        let at = DVec2::new(Page::margin_px(self.params.width_px), end_px);
        let (key, key_px) = self.key(&first.page, at);
        let height = (end_px + key_px + Page::margin_px(self.params.width_px)) as u32;
        sheet.groups.extend(key);
        sheet.size = [self.params.width_px, height];
        sheet.frames.iter_mut().for_each(|frame| frame.page.height = height);
        self.thin_if_needed(&mut sheet.frames);
        let marks: Vec<Group> = sheet.frames.iter().map(|frame| self.marks(frame)).collect();
        sheet.groups.extend(marks);
        sheet.groups.extend(numbers::at_branches(self, &sheet));
        Ok(sheet)
    }

    /// Whether tubes would be as thin as lines, and so the same picture twice.
    fn is_fine(&self, [low, high]: [DVec2; 2]) -> bool {
        let px_per_mm = 0.3 * f64::from(self.params.width_px) / (high - low).max_element().max(SMALLEST_MM);
        let width_px = 2.0 * self.subject.tree.mean_radius_mm() * self.params.width_scale * px_per_mm;
        width_px < 1.5 * LINE_PEN * self.params.min_width_px
    }

    /// The box of what is seen in space, mm.
    fn bounds_mm(&self, seen: &Scene, surface: Option<&Surface<'_>>) -> [DVec2; 2] {
        let (low, high) = seen.bounds_mm();
        let Some(surface) = surface else { return [low, high] };
        let [least, most] = surface.bounds_mm();
        [low.min(least), high.max(most)]
    }

    /// Puts the panels below a height, beside or below each other; gives the height that they end at.
    fn tile(&self, panels: Vec<(Kind, Scene, [DVec2; 2])>, top_px: f64, sheet: &mut Sheet<'_>) -> f64 {
        let (width, unit) = (self.params.width_px, Page::unit_px(self.params.width_px));
        let margin_px = Page::margin_px(width);
        let size_mm = |[low, high]: [DVec2; 2]| (high - low).max(DVec2::splat(SMALLEST_MM));
        let sizes_mm: Vec<DVec2> = panels.iter().map(|(_, _, bounds)| size_mm(*bounds)).collect();
        let sum_mm = sizes_mm.iter().sum::<DVec2>();
        let most_mm = sizes_mm.iter().copied().fold(DVec2::ZERO, DVec2::max);
        let n_panels = sizes_mm.len() as f64;
        let (gap_px, rim_px, title_px) = (GAP * unit, RIM * unit, LEADING * TITLE * unit);
        // The scale for n panels beside each other, of this size together.
        let scale = |n_columns: f64, n_rows: f64, all_mm: DVec2| {
            let beside_px = 2.0 * (margin_px + n_columns * rim_px) + (n_columns - 1.0) * gap_px;
            let above_px = n_rows * (2.0 * rim_px + title_px + gap_px);
            let room = DVec2::new(f64::from(width) - beside_px, MOST_HEIGHT * f64::from(width) - above_px);
            (room.max(DVec2::splat(LEAST_ROOM * unit)) / all_mm).min_element()
        };
        let beside = scale(n_panels, 1.0, DVec2::new(sum_mm.x, most_mm.y));
        let below = scale(1.0, n_panels, DVec2::new(most_mm.x, sum_mm.y));
        let px_per_mm = beside.max(below);
        let mut corner = DVec2::new(margin_px, top_px + 1.4 * unit + title_px);
        let mut end_px = corner.y;
        for ((kind, scene, bounds), size_mm) in panels.into_iter().zip(sizes_mm) {
            let shown_mm = if beside >= below { size_mm.with_y(most_mm.y) } else { size_mm };
            let low = corner.floor();
            let area = [low, low + (px_per_mm * shown_mm + 2.0 * rim_px).floor()];
            let page = self.page(kind, area, (px_per_mm, 0.5 * (bounds[0] + bounds[1])));
            let kinship = Kinship::new(self.subject.tree, self.branches, &scene, px_per_mm);
            sheet.frames.push(Frame { kind, scene, page, kinship });
            end_px = area[1].y + gap_px;
            if beside >= below {
                corner.x = area[1].x + gap_px;
            } else {
                corner.y = end_px + title_px;
            }
        }
        end_px
    }

    /// The page of a panel, with a point of its scene in the middle of its area.
    fn page(&self, kind: Kind, area: [DVec2; 2], (px_per_mm, middle_mm): (f64, DVec2)) -> Page {
        let (style, share) = match kind {
            Kind::Line => (Style::Line, LINE_PEN),
            _ => (self.params.style, TUBE_PEN),
        };
        Page {
            width: self.params.width_px,
            height: 0,
            unit_px: Page::unit_px(self.params.width_px),
            px_per_mm,
            origin_px: 0.5 * (area[0] + area[1]) - px_per_mm * DVec2::new(middle_mm.x, -middle_mm.y),
            area,
            key_at: area[0],
            pen: Pen { min_width_px: share * self.params.min_width_px, style },
        }
    }

    /// Tubes and map become lines if their radii would cover a panel too often.
    fn thin_if_needed(&self, frames: &mut [Frame]) {
        let is_thick = |frame: &Frame| {
            frame.page.pen.style == Style::PseudoSurface && {
                let page = frame.page.panel();
                raster::layers(page.size(), &self.sketched(frame, &page)) > MAX_LAYERS
            }
        };
        if frames.iter().any(is_thick) {
            frames.iter_mut().for_each(|frame| frame.page.pen.style = Style::Line);
        }
    }

    fn said(&self) -> Heading {
        let title = self.params.title.as_ref().map(|title| format!("{title}: in space and on the plane"));
        let mut verdict = vec!["same colour and same number = same branch".to_owned()];
        if self.params.color_by == ColorBy::Part {
            verdict = vec!["same colour = same subtree, same number = same branch".to_owned()];
        } else if self.coloring.scale.is_some() {
            verdict = vec!["same number = same branch".to_owned()];
        }
        verdict.push(self.seen_from());
        let mut facts = heading::size_of(self.subject.tree, self.branches, self.params);
        facts.push("numbers as in branches.tsv".to_owned());
        Heading { title, verdict, facts }
    }

    fn seen_from(&self) -> String {
        let is_body = self.params.compass != Compass::Axes;
        match self.params.space_view {
            SpaceView::Global => "in space as the global view sees it".to_owned(),
            SpaceView::Coronal if is_body => "in space seen from the front".to_owned(),
            SpaceView::Sagittal if is_body => "in space seen from the left".to_owned(),
            SpaceView::Axial if is_body => "in space seen from the feet".to_owned(),
            SpaceView::Coronal => "in space seen along −y".to_owned(),
            SpaceView::Sagittal => "in space seen along +x".to_owned(),
            SpaceView::Axial => "in space seen along +z".to_owned(),
        }
    }

    /// Title, root and letters of a panel.
    fn marks(&self, frame: &Frame) -> Group {
        let unit = frame.page.unit_px;
        let [low, _] = frame.page.area;
        let mut marks = Vec::from(root_mark::ring(&frame.page, &frame.scene, &self.colors));
        if frame.kind != Kind::Map {
            let axes = [self.view.right(), self.view.up];
            let compass = furniture::compass(&frame.page, axes, self.params.compass, &self.colors);
            marks.extend(compass.into_iter().flat_map(|group| group.marks));
        }
        let title = match frame.kind {
            Kind::Surface => "in space: the mask",
            Kind::Tubes => "in space: the tree",
            Kind::Line => "in space: the centreline",
            Kind::Map => "on the plane: the map",
        };
        let at = DVec2::new(low.x, low.y - 0.45 * TITLE * unit);
        marks.push(self.text(at, (TITLE, true), self.colors.ink, title));
        Group { name: "panel", marks }
    }
}
