//! The organ in space beside its map, in the same colours, so that a branch is found again.
//!
//! **Input** the tree, its embedding, a view, the mask by branch where there is one. **Output** PNG and SVG: the surface of
//! the organ (of a traced tree its tubes, unless they are as thin as lines), the centreline, the map, all at one scale.
//! **Files** `field`, `cast`, `relief`: the surface; `layout`: the panels in their places;
//! `key`, `numbers`: which branch is which.
//! **Steps** 1. The view: the global one or a plane of the body. 2. Panels side by side. 3. Each branch has its colour, the
//! same in every panel; the long ones that find room have their numbers in both worlds.
//! **Guarantees** the same bytes for any number of threads; at most [`MOST_WIDTH`] pixels wide.
//! **Source** ours. **Cost** that of three small pictures and of the rays onto the surface.

mod cast;
mod field;
mod key;
mod layout;
mod numbers;
mod relief;

use espalier_model::{Branches, Embedding, Tree, View};
use glam::{DVec2, DVec3};

pub use cast::Organ;
use cast::{Rays, Surface};
use relief::{Relief, WINDOW_UNITS};

use crate::coloring::{self, Coloring};
use crate::drawing::{Group, Mark};
use crate::kinship::Kinship;
use crate::orientation::Orientation;
use crate::page::Page;
use crate::paint::Canvas;
use crate::palette::{PageColors, Rgb};
use crate::params::{ColorBy, Params, SpaceView};
use crate::raster::{Drawn, Job, Pixel, Raster};
use crate::scene::Scene;
use crate::side_by_side::SideBySide;
use crate::text::{Anchor, Face};
use crate::{Error, sketch, svg};

/// The most pixels that the figure of the organ in space is wide: more show no more of a mask of a thousand voxels.
pub const MOST_WIDTH: u32 = 4096;
/// The font size of notes in layout units, and line height over font size.
const NOTE: f64 = 1.12;
const LEADING: f64 = 1.4;
/// Rays of a pixel along an axis.
const N_RAYS: usize = 2;

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
    fn sketched(&self, frame: &Frame, page: &Page) -> Vec<Drawn> {
        sketch::edges(self.subject.tree, &frame.scene, page, self.coloring, &frame.kinship)
    }

    fn text(&self, at: DVec2, (size, is_strong): (f64, bool), color: Rgb, text: &str) -> Mark {
        let size_px = size * Page::unit_px(self.params.width_px);
        Mark::Text { at, size_px, anchor: Anchor::Start, is_strong, color, text: text.to_owned() }
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
        let title = self.params.title.as_deref().unwrap_or("a tree in space and on the plane");
        let items: Vec<svg::Item<'_>> =
            sheet.frames.iter().map(|frame| self.item(frame, picture.as_deref(), title)).collect();
        let svg = svg::figure(("space", title), (&items, &sheet.groups), (sheet.size, &self.colors));
        Ok(SideBySide { png: canvas.png(), svg })
    }

    /// What a panel shows in the document; `picture` is the surface's.
    fn item<'s>(&'s self, frame: &'s Frame, picture: Option<&'s [u8]>, title: &'s str) -> svg::Item<'s> {
        if let (Kind::Surface, Some(png)) = (frame.kind, picture) {
            return svg::Item::Picture("surface", png, &frame.page);
        }
        let prefix = match frame.kind {
            Kind::Surface => "surface-",
            Kind::Tubes => "space-",
            Kind::Line => "line-",
            Kind::Map => "map-",
        };
        let content = svg::Content {
            tree: self.subject.tree,
            branches: self.branches,
            scene: &frame.scene,
            coloring: self.coloring,
            title,
            prefix,
        };
        svg::Item::Tree(content, &frame.page)
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
