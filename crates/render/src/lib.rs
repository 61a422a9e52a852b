//! Pictures of an embedded tree: pseudo-surface or lines, as PNG, SVG and EXR, beside the tree in space.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 1 | `scene` | nodes in picture space: the map, or the global view |
//! | 2 | `coloring`, `palette`, `unit` | a value for each end of each edge, its colour, its scale |
//! | 3 | `heading`, `furniture`, `text` | what stands beside the tree, and how much room it needs |
//! | 4 | `page` | scale and places |
//! | 5 | `sketch`, `cone`, `kinship` | edges as round cones in pixels |
//! | 6 | `raster`, `samples`, `shade` | the pixels |
//! | 7 | `paint`, `svg`, `outline`, `layers` | the files |
//!
//! **Source** section 4.1 of [Hu2022].

mod params;

mod scene;

mod coloring;
mod palette;
mod unit;

mod drawing;
mod furniture;
mod heading;
mod text;

mod page;

mod cone;
mod kinship;
mod sketch;

mod raster;
mod samples;
mod shade;

mod layers;
mod outline;
mod paint;
mod svg;

mod error;

use espalier_model::{Branches, Embedding, Report, Tree, ViewHierarchy};

use coloring::Coloring;
pub use error::Error;
use furniture::Heading;
use kinship::Kinship;
use page::{Needs, Page, Pen};
use palette::PageColors;
pub use params::{ColorBy, Compass, Params, Style, Theme, Unit};
use raster::{Job, Pixel};
use scene::Scene;
use text::Face;

/// The pictures of a tree.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendered {
    /// The map as PNG, sRGB, 8 bits.
    pub png: Vec<u8>,
    /// The map as SVG, one path per branch with the id `branch-N`.
    pub svg: String,
    /// The map's layers as OpenEXR, on the PNG's pixels; `None` if [`Params::exr`] is false.
    pub exr: Option<Vec<u8>>,
    /// The tree in space from the global view as PNG, in the same colours.
    pub global_view_png: Vec<u8>,
    /// Sizes and scales.
    pub report: Report,
}

/// Draws an embedded tree.
///
/// The channels of the EXR: `R G B A`, `radius.mm`, `height.mm`, `normal.X Y Z`, `arc.mm`, `branch.id`, `node.id`,
/// `position.X Y Z` (RAS+ mm), `loss.angle` (degrees), `loss.length` (share); where `A` is 0, ids are −1 and all
/// else is 0.
///
/// # Errors
/// [`Error`] if a parameter is out of range, the embedding is another tree's, a number cannot be drawn, or the
/// picture would be over 2²⁵ pixels.
pub fn render(
    tree: &Tree,
    embedding: &Embedding,
    views: &ViewHierarchy,
    params: &Params,
) -> Result<Rendered, Error> {
    params.validate()?;
    check_entries(tree, embedding)?;
    let artist = Artist {
        tree,
        branches: &tree.branches(),
        coloring: &coloring::color(tree, &tree.branches(), embedding, params),
        params,
        face: Face::built_in()?,
        colors: PageColors::of(params.theme),
    };

    let map = Scene::planar(tree, embedding, params.width_scale)?;
    let said = heading::planar(tree, artist.branches, embedding, params);
    let (page, groups) = artist.lay_out(&map, &said, None)?;
    let pixels = artist.draw(&map, &page, Depth::Flat);
    let title = params.title.as_deref().unwrap_or("planar map of a tree");
    let content =
        svg::Content { tree, branches: artist.branches, scene: &map, coloring: artist.coloring, title };
    let layers = || layers::Layers::new(tree, artist.branches, embedding, (&page, &pixels)).encode();

    Ok(Rendered {
        png: paint::png(&page, &pixels, &groups, (artist.colors.background, &artist.face))?,
        svg: svg::svg(&content, &page, &groups, &artist.colors),
        exr: params.exr.then(layers).transpose()?,
        global_view_png: artist.global_view(views)?,
        report: report(tree, &map, &page, &pixels),
    })
}

/// Whether edges can pass in front of each other.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Depth {
    Flat,
    Spatial,
}

/// What the map and the global view have in common.
struct Artist<'a> {
    tree: &'a Tree,
    branches: &'a Branches,
    coloring: &'a Coloring,
    params: &'a Params,
    face: Face,
    colors: PageColors,
}

impl Artist<'_> {
    fn global_view(&self, views: &ViewHierarchy) -> Result<Vec<u8>, Error> {
        let view = &views.global;
        let scene = Scene::seen(self.tree, view, self.params.width_scale)?;
        let said = heading::global(self.tree, self.branches, view, self.params);
        let axes = [view.up.cross(view.towards_camera), view.up];
        let (page, groups) = self.lay_out(&scene, &said, Some(axes))?;
        let pixels = self.draw(&scene, &page, Depth::Spatial);
        paint::png(&page, &pixels, &groups, (self.colors.background, &self.face))
    }

    /// The page of a scene and all its marks; with letters at the edges if `axes` (right, up) are given.
    fn lay_out(
        &self,
        scene: &Scene,
        said: &Heading,
        axes: Option<[glam::DVec3; 2]>,
    ) -> Result<(Page, Vec<drawing::Group>), Error> {
        let Self { tree, coloring, params, face, colors, .. } = self;
        let (heading, heading_px) = furniture::heading(face, said, params.width_px, colors);
        let unit_px = Page::unit_px(params.width_px);
        let needs = Needs {
            heading_px,
            key_px: furniture::key_size(face, coloring, params.width_px),
            rim_px: unit_px * if axes.is_some() { 4.2 } else { 2.2 },
        };
        let pen = Pen { min_width_px: params.min_width_px, style: params.style };
        let page = Page::lay_out(tree, scene, (params.width_px, pen), &needs)?;
        let mut groups = vec![heading];
        groups.extend(furniture::key(&page, coloring, params, colors));
        groups.push(furniture::root_mark(&page, tree, scene, colors));
        groups.extend(axes.and_then(|axes| furniture::compass(&page, axes, params.compass, colors)));
        Ok((page, groups))
    }

    fn draw(&self, scene: &Scene, page: &Page, depth: Depth) -> Vec<Pixel> {
        let kinship = Kinship::new(self.tree, self.branches, scene, page.px_per_mm);
        let drawn = sketch::edges(self.tree, scene, page, self.coloring, &kinship);
        raster::rasterise(&Job {
            size: [page.width as usize, page.height as usize],
            drawn: &drawn,
            kinship: &kinship,
            palette: &self.coloring.palette,
            colors: self.colors,
            style: self.params.style,
            has_depth: depth == Depth::Spatial,
        })
    }
}

/// One entry per node, all finite.
fn check_entries(tree: &Tree, embedding: &Embedding) -> Result<(), Error> {
    let n_nodes = tree.n_nodes();
    for (what, n_entries) in [
        ("positions", embedding.positions_mm.len()),
        ("target angles", embedding.targets.angle_rad.len()),
        ("target lengths", embedding.targets.length_mm.len()),
    ] {
        if n_entries != n_nodes {
            return Err(Error::Mismatch { what, n_entries, n_nodes });
        }
    }
    Ok(())
}

fn report(tree: &Tree, scene: &Scene, page: &Page, pixels: &[Pixel]) -> Report {
    let mut report = Report::default();
    report.count("width_px", page.width);
    report.count("height_px", page.height);
    report.count("mm_per_px", 1.0 / page.px_per_mm);
    let is_thin =
        |&(node, _): &(usize, usize)| scene.radii_mm[node] * page.px_per_mm < 0.5 * page.pen.min_width_px;
    report.count_usize("edges", tree.n_nodes() - 1);
    report.count_usize("edges_at_least_width", tree.edges().filter(is_thin).count());
    let n_covered = pixels.iter().filter(|pixel| pixel.is_covered()).count();
    report.count("covered_percent", 100.0 * n_covered as f64 / pixels.len().max(1) as f64);
    report
}
