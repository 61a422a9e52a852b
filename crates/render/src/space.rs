//! The organ in space beside its map, in the same colours, so that a branch is found again.
//!
//! **Input** the tree, its embedding, a view, the mask by branch where there is one. **Output** PNG and SVG: the surface of
//! the organ (of a traced tree its tubes, unless they are as thin as lines), the centreline, the map, all at one scale.
//! **Files** `field`, `cast`, `relief`: the surface; `numbers`: which branch is which; `document`: the SVG.
//! **Steps** 1. The view: the global one or a plane of the body. 2. Panels side by side. 3. Each branch has its colour, the
//! same in every panel; the long ones that find room have their numbers in both worlds.
//! **Guarantees** the same bytes for any number of threads; at most [`MOST_WIDTH`] pixels wide.
//! **Source** ours. **Cost** that of three small pictures and of the rays onto the surface.

mod cast;
mod document;
mod field;
mod numbers;
mod relief;

use espalier_model::{Branches, Embedding, Tree, View};
use glam::{DVec2, DVec3};

pub use cast::Organ;
use cast::{Rays, Surface};
use relief::{Relief, WINDOW_UNITS};

use crate::coloring::{self, Coloring};
use crate::drawing::{Group, Mark};
use crate::furniture::{self, Heading};
use crate::kinship::Kinship;
use crate::orientation::Orientation;
use crate::page::{Page, Pen};
use crate::paint::Canvas;
use crate::palette::{PageColors, Palette, Rgb};
use crate::params::{ColorBy, Compass, Params, SpaceView, Style};
use crate::raster::{self, Drawn, Job, Pixel, Raster};
use crate::scene::Scene;
use crate::sheet::MAX_LAYERS;
use crate::side_by_side::SideBySide;
use crate::text::{Anchor, Face};
use crate::{Error, heading, root_mark, sketch};

/// Wider figures show no more of a mask of a thousand voxels.
const MOST_WIDTH: u32 = 4096;
/// Sizes in layout units: font sizes, space between panels, space around a tree with its letters, the least room of
/// all trees together.
const TITLE: f64 = 1.5;
const NOTE: f64 = 1.12;
const GAP: f64 = 1.6;
const RIM: f64 = 3.4;
const LEAST_ROOM: f64 = 8.0;
/// A tree smaller than this has no scale of its own, mm.
const SMALLEST_MM: f64 = 1e-12;
/// Line height over font size.
const LEADING: f64 = 1.4;
/// Height of the panels over the width of the page, and of the key in layout units.
const MOST_HEIGHT: f64 = 0.7;
const KEY: f64 = 5.0;
/// Width of tubes and of the centreline at least, as shares of `min_width_px`.
const TUBE_PEN: f64 = 0.8;
const LINE_PEN: f64 = 1.3;
/// Rays of a pixel along an axis.
const N_RAYS: usize = 2;
/// Colours in the key; what is more is counted.
const MOST_SWATCHES: usize = 21;

/// What the figure shows.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    /// The tree.
    pub tree: &'a Tree,
    /// Its embedding.
    pub embedding: &'a Embedding,
    /// Its global view.
    pub view: &'a View,
    /// The mask by branch; none of a traced tree.
    pub organ: Option<Organ<'a>>,
    /// By how many degrees the map was turned to fit its page, as [`crate::Rendered`] says.
    pub turn_deg: u32,
}

/// Draws the organ in space, its centreline and the map side by side.
///
/// Colours are those of the branches ([`crate::branch_colors`]), or what `params.color_by` says if that is another way to
/// tell branches apart: by generation, part or label.
///
/// # Errors
/// [`Error`] if a parameter is out of range, the embedding is another tree's, or a number cannot be drawn.
pub fn space(subject: &Subject<'_>, params: &Params) -> Result<SideBySide, Error> {
    params.validate()?;
    crate::check_entries(subject.tree, subject.embedding)?;
    let params = &Params { width_px: params.width_px.min(MOST_WIDTH), ..params.without_scan() };
    let view = seen_from(subject.view, params.space_view);
    let branches = subject.tree.branches();
    let flat = Scene::planar(subject.tree, subject.embedding, params.width_scale)?;
    let coloring = color(subject, &branches, &flat, params);
    let artist = Artist {
        subject: *subject,
        branches: &branches,
        coloring: &coloring,
        params,
        face: Face::built_in()?,
        colors: PageColors::of(params.theme),
        view,
    };
    let sheet = artist.lay_out(flat.turned(subject.turn_deg))?;
    artist.draw(&sheet)
}

/// The global view, or one along an axis of the body: from the front, from the left, from the feet.
fn seen_from(global: &View, kind: SpaceView) -> View {
    let (towards_camera, up) = match kind {
        SpaceView::Global => return *global,
        SpaceView::Coronal => (DVec3::Y, DVec3::Z),
        SpaceView::Sagittal => (DVec3::NEG_X, DVec3::Z),
        SpaceView::Axial => (DVec3::NEG_Z, DVec3::Y),
    };
    View { towards_camera, up, ..*global }
}

fn color(subject: &Subject<'_>, branches: &Branches, flat: &Scene, params: &Params) -> Coloring {
    let color_by = match params.color_by {
        ColorBy::Generation | ColorBy::Part | ColorBy::Label => params.color_by,
        _ => ColorBy::Branch,
    };
    let params = Params { color_by, ..params.clone() };
    let orientation = Orientation::of(subject.tree, flat);
    coloring::color((subject.tree, branches), subject.embedding, &orientation, &params)
}

/// How a panel is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// The surface of the mask.
    Surface,
    /// The tubes of the tree.
    Tubes,
    /// The centreline.
    Line,
    /// The map.
    Map,
}

/// A panel in its place.
struct Frame {
    kind: Kind,
    scene: Scene,
    /// The page as the whole figure sees it: `area` is the panel's.
    page: Page,
    kinship: Kinship,
}

/// The figure, laid out.
struct Sheet<'a> {
    frames: Vec<Frame>,
    surface: Option<Surface<'a>>,
    groups: Vec<Group>,
    size: [u32; 2],
}

struct Artist<'a> {
    subject: Subject<'a>,
    branches: &'a Branches,
    coloring: &'a Coloring,
    params: &'a Params,
    face: Face,
    colors: PageColors,
    view: View,
}

impl<'a> Artist<'a> {
    fn lay_out(&self, flat: Scene) -> Result<Sheet<'a>, Error> {
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

    fn sketched(&self, frame: &Frame, page: &Page) -> Vec<Drawn> {
        sketch::edges(self.subject.tree, &frame.scene, page, self.coloring, &frame.kinship)
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

    fn text(&self, at: DVec2, (size, is_strong): (f64, bool), color: Rgb, text: &str) -> Mark {
        let size_px = size * Page::unit_px(self.params.width_px);
        Mark::Text { at, size_px, anchor: Anchor::Start, is_strong, color, text: text.to_owned() }
    }

    /// Scale bar and what the colours mean, and their height.
    fn key(&self, page: &Page, at: DVec2) -> (Vec<Group>, f64) {
        let unit = page.unit_px;
        let mut groups = Vec::new();
        groups.extend(furniture::scale_bar(page, at, self.params, &self.colors));
        let mut marks = Vec::new();
        let left = at.x + 14.0 * unit;
        let right = f64::from(page.width) - Page::margin_px(page.width);
        let mut pen = DVec2::new(left, at.y + 2.9 * unit);
        for (color, text) in self.swatches() {
            let width = f64::from(self.face.width(&text, (NOTE * unit) as f32)) + 3.2 * unit;
            if pen.x + width > right && pen.x > left {
                pen = DVec2::new(left, pen.y + LEADING * 1.2 * NOTE * unit);
            }
            if let Some(palette) = color {
                let corner = pen - DVec2::new(0.0, 0.95 * unit);
                marks.push(Mark::Bar { corner, size: DVec2::splat(1.1 * unit), palette });
            }
            let indent = if marks.is_empty() { 0.0 } else { 1.6 * unit };
            marks.push(self.text(pen + DVec2::new(indent, 0.0), (NOTE, false), self.colors.soft, &text));
            pen.x += width;
        }
        groups.push(Group { name: "key", marks });
        (groups, (pen.y - at.y - 2.9 * unit) + KEY * unit)
    }

    /// What the key says of the colours.
    fn swatches(&self) -> Vec<(Option<Palette>, String)> {
        let Some(scale) = &self.coloring.scale else { return Vec::new() };
        let swatch = |position: f64| Some(self.coloring.palette.only(position as f32));
        let mut list: Vec<_> = scale
            .ticks
            .iter()
            .take(MOST_SWATCHES)
            .map(|tick| (swatch(tick.position), tick.text.clone()))
            .collect();
        if let (Some((_, first)), ColorBy::Generation) = (list.first_mut(), self.params.color_by) {
            *first = format!("{} {first}", scale.caption);
        }
        if scale.ticks.len() > MOST_SWATCHES {
            list.push((None, format!("… and {} more", scale.ticks.len() - MOST_SWATCHES)));
        }
        list
    }

    fn draw(&self, sheet: &Sheet<'_>) -> Result<SideBySide, Error> {
        let mut canvas = Canvas::new(sheet.size, self.colors.background)?;
        let mut picture = None;
        for frame in &sheet.frames {
            let page = frame.page.panel();
            let corner = [frame.page.area[0].x as usize, frame.page.area[0].y as usize];
            if let (Kind::Surface, Some(surface)) = (frame.kind, &sheet.surface) {
                let pixels = self.relief(surface, &page);
                canvas.lay(&pixels, page.size()[0], corner);
                picture = Some(self.packed(&pixels, &page)?);
                continue;
            }
            let drawn = self.sketched(frame, &page);
            let raster = Raster::new(Job {
                size: page.size(),
                drawn: &drawn,
                kinship: &frame.kinship,
                palette: &self.coloring.palette,
                colors: self.colors,
                style: page.pen.style,
                has_depth: frame.kind != Kind::Map,
            });
            canvas.surface(&raster, corner, |_, _| ());
        }
        canvas.mark(&sheet.groups, &self.face);
        Ok(SideBySide { png: canvas.png(), svg: self.svg(sheet, picture.as_deref()) })
    }

    /// The surface in a panel.
    fn relief(&self, surface: &Surface<'_>, page: &Page) -> Vec<Pixel> {
        let n = N_RAYS;
        let size = page.size().map(|pixels| pixels * n);
        let step_mm = 1.0 / (page.px_per_mm * n as f64);
        // The first ray goes through the middle of its part of the first pixel.
        let first_px = DVec2::splat(0.5 / n as f64) - page.origin_px;
        let first_mm = DVec2::new(first_px.x, -first_px.y) / page.px_per_mm;
        let hits = surface.cast(&Rays { first_mm, step_mm, size });
        let window = (WINDOW_UNITS * page.unit_px * n as f64) as usize;
        let branch_colors = self.branch_colors();
        let colors = self.colors;
        let relief = Relief {
            hits: &hits,
            size,
            n,
            step_mm,
            voxel_mm: surface.voxel_mm(),
            window,
            branch_colors: &branch_colors,
            colors,
        };
        relief.pixels()
    }

    /// By branch: the colour of its middle.
    fn branch_colors(&self) -> Vec<Rgb> {
        let middle = |nodes: &std::ops::Range<usize>| nodes.start + nodes.len() / 2;
        let value = |node: usize| self.coloring.ends[node][1];
        let list = self.branches.list().iter();
        list.map(|branch| self.coloring.palette.at(value(middle(&branch.nodes)))).collect()
    }

    /// Pixels on the page's paper as PNG.
    fn packed(&self, pixels: &[Pixel], page: &Page) -> Result<Vec<u8>, Error> {
        let mut canvas = Canvas::new([page.width, page.height], self.colors.background)?;
        canvas.lay(pixels, page.size()[0], [0, 0]);
        Ok(canvas.png())
    }
}
