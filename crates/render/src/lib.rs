//! Pictures of an embedded tree: pseudo-surface or lines, as PNG, SVG and EXR, beside the tree in space.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 0 | `map` | what each point of the plane stands for in the patient |
//! | 1 | `scene` | nodes in picture space: the map, or the global view |
//! | 2 | `coloring`, `branch_names`, `palette`, `unit`, `color_table` | a value for each end of each edge, its colour, its scale |
//! | 3 | `heading`, `furniture`, `text` | what stands beside the tree, and how much room it needs |
//! | 4 | `page` | scale and places |
//! | 5 | `sketch`, `cone`, `kinship` | edges as round cones in pixels |
//! | 6 | `raster`, `tiles`, `samples`, `shade` | the pixels |
//! | 7 | `reformation` | the pixels of a scan along the map, in place of 5 and 6 |
//! | 8 | `paint`, `svg`, `outline`, `layers` | the files |
//! | 9 | `side_by_side`, `tiling`, `parts`; `space`; `juxtaposed`; `chart`, `convergence`, `profile`; `thumbnail` | several layouts in one figure; the organ in space beside its map; two trees on one map; charts of numbers; a map among many |
//!
//! **Source** section 4.1 of [Hu2022].

mod params;

mod map;

mod scene;

mod branch_names;
mod color_table;
mod coloring;
mod orientation;
mod palette;
mod unit;

mod drawing;
mod furniture;
mod heading;
mod letters;
mod text;

mod page;

mod cone;
mod kinship;
mod sketch;

mod raster;
mod samples;
mod shade;
mod tiles;

mod reformation;

mod layers;
mod outline;
mod paint;
mod pdf;
mod png;
mod svg;

mod chart;
mod convergence;
mod juxtaposed;
mod parts;
mod profile;
mod side_by_side;
mod space;
mod thumbnail;
mod tiling;

mod error;

use espalier_model::{Branches, Embedding, Report, Tree, ViewHierarchy, Volume};
use glam::DVec3;

pub use branch_names::branch_colors;
pub use chart::{Chart, Charts, charts};
pub use color_table::{ColorTable, color_table};
use coloring::Coloring;
pub use convergence::{Searched, convergence};
pub use error::Error;
use furniture::Heading;
pub use juxtaposed::{ChangeOf, juxtaposed};
use kinship::Kinship;
use layers::Layers;
pub use map::{Beside, Place, PlanarMap, reach};
use orientation::Orientation;
use page::{Needs, Page, Paper, Pen};
use paint::Canvas;
use palette::PageColors;
pub use params::{ColorBy, Compass, Fit, LabelEntry, Labels, Params, SpaceView, Style, Theme, Unit};
pub use profile::{Stretch, Way, profile};
use raster::{Drawn, Job, Pixel, Raster};
pub use reformation::params::{Slab, VolumeParams, Window};
use reformation::{Reformation, Tally};
use scene::Scene;
pub use side_by_side::{Panel, Section, SideBySide, side_by_side};
pub use space::{Organ, Subject as SpaceSubject, space};
use text::Face;
pub use thumbnail::{Thumbnail, thumbnail};

/// The pictures of a tree.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendered {
    /// The map as PNG, sRGB, 8 bits.
    pub png: Vec<u8>,
    /// The map as SVG, one path per branch with the id `branch-N`.
    pub svg: String,
    /// The map as PDF, 300 pixels to an inch; `None` if [`Params::pdf`] is false.
    pub pdf: Option<Vec<u8>>,
    /// The map's layers as OpenEXR, on the PNG's pixels; `None` if [`Params::exr`] is false.
    pub exr: Option<Vec<u8>>,
    /// The tree in space from the global view as PNG, in the same colours.
    pub global_view_png: Vec<u8>,
    /// By how many degrees the map was turned counter-clockwise to fit its page.
    pub turn_deg: u32,
    /// Sizes and scales.
    pub report: Report,
}

/// Draws an embedded tree.
///
/// The channels of the EXR: `R G B A`, `radius.mm`, `height.mm`, `normal.X Y Z`, `arc.mm`, `branch.id`, `node.id`,
/// `position.X Y Z` (RAS+ mm), `loss.angle` (degrees), `loss.length` (share); where `A` is 0, ids are −1 and all
/// else is 0.
///
/// Radii that cover the picture several times over, as in a wrong unit, are not drawn: it shows lines then, its
/// heading says so, and the report warns with `W-RENDER-THICK`.
///
/// # Errors
/// [`Error`] if a parameter is out of range, the embedding is another tree's, a number cannot be drawn, the picture would
/// be over 2²⁷ pixels, or the style is that of a scan: see [`render_scan`].
pub fn render(
    tree: &Tree,
    embedding: &Embedding,
    views: &ViewHierarchy,
    params: &Params,
) -> Result<Rendered, Error> {
    draw_all((tree, embedding, views), None, params)
}

/// Draws an embedded tree with the scan along its branches, as [`Style::Volume`] has it; in any other style as
/// [`render`]. The scan needs to hold no more than what [`VolumeParams::farthest_mm`] says around each node; its values
/// are taken as they are, in HU where some are under −200.
///
/// The EXR has one more channel then, `volume.value`.
///
/// # Errors
/// As [`render`], and where less than half of the tree lies in the scan.
pub fn render_scan(
    (tree, embedding, views): (&Tree, &Embedding, &ViewHierarchy),
    scan: &Volume,
    params: &Params,
) -> Result<Rendered, Error> {
    draw_all((tree, embedding, views), Some(scan), params)
}

fn draw_all(
    (tree, embedding, views): (&Tree, &Embedding, &ViewHierarchy),
    scan: Option<&Volume>,
    params: &Params,
) -> Result<Rendered, Error> {
    params.validate()?;
    check_entries(tree, embedding)?;
    let branches = tree.branches();
    let scene = Scene::planar(tree, embedding, params.drawn_width_scale())?;
    let map = PlanarMap::of(tree, embedding, views);
    let reformation = match (params.style, scan) {
        (Style::Volume, None) => return Err(Error::NoScan),
        (Style::Volume, Some(scan)) => {
            let rule = PageColors::of(params.theme).soft;
            Some(Reformation::new((tree, &map), scan, (&params.volume, rule))?)
        }
        _ => None,
    };
    // The losses do not depend on how the whole is turned.
    let orientation = Orientation::of(tree, &scene);
    let own_params = params.without_scan();
    let face = Face::built_in()?;
    let artist = Artist {
        tree,
        branches: &branches,
        coloring: &coloring::color((tree, &branches), embedding, &orientation, params),
        params: &own_params,
        face: &face,
        colors: PageColors::of(params.theme),
    };
    let greys = reformation.as_ref().map(|reformation| reformation.greys().coloring(tree.n_nodes()));
    let on_map = Artist { coloring: greys.as_ref().unwrap_or(artist.coloring), params, ..artist.clone() };

    let said = heading::planar((tree, &branches), embedding, &orientation, params);
    let said = match &reformation {
        Some(reformation) => heading::with_scan(said, reformation.greys(), &params.volume),
        None => said,
    };
    let scene = on_map.turned(scene, &said)?;
    let axes = Orientation::of(tree, &scene).axes;
    let flat = on_map.sheet(scene, said, Depth::Flat { axes })?;
    let view = &views.global;
    let global = artist.sheet(
        Scene::seen(tree, view, params.width_scale)?,
        heading::global(tree, artist.branches, view, params),
        Depth::Spatial { axes: [view.up.cross(view.towards_camera), view.up] },
    )?;

    // Radii that nothing can be drawn with leave lines, and no room for a scan.
    let reformation = reformation.filter(|_| flat.page.pen.style == Style::Volume);
    let layers = params.exr.then(|| {
        let on_page = (&flat.page, flat.scene.turn_deg, reformation.is_some());
        Layers::new((tree, artist.branches), (&map, embedding), &orientation, on_page)
    });
    let blocks = |first_row: usize, pixels: &[Pixel], values: &[f32]| {
        layers.as_ref().map(|layers| layers.blocks(first_row, pixels, values)).unwrap_or_default()
    };
    let n_covered = |pixels: &[Pixel]| pixels.iter().filter(|pixel| pixel.is_covered()).count();
    let (drawing, tally) = match &reformation {
        Some(reformation) => on_map.draw_scan(&flat, reformation, |first_row, band| {
            (n_covered(&band.pixels), blocks(first_row, &band.pixels, &band.values))
        })?,
        None => {
            let look = |first_row, pixels: &[Pixel]| (n_covered(pixels), blocks(first_row, pixels, &[]));
            (on_map.draw(&flat, look)?, Tally::default())
        }
    };
    let n_covered = drawing.seen.iter().map(|(n_covered, _)| n_covered).sum();
    let blocks = drawing.seen.into_iter().flat_map(|(_, blocks)| blocks).collect();
    let title = params.title.as_deref().unwrap_or("planar map of a tree");
    let content = svg::Content {
        tree,
        branches: artist.branches,
        scene: &flat.scene,
        coloring: on_map.coloring,
        title,
        prefix: "",
    };
    let pdf = drawing.stream.map(|stream| {
        let drawn = pdf::Drawn::of(&content, &flat.page, &artist.colors, stream);
        pdf::pdf(&flat.page, (drawn, &flat.groups), (artist.colors.background, artist.face), title)
    });
    let mut report = report(tree, [&flat, &global], n_covered);
    if let Some(reformation) = &reformation {
        reformation.report(&tally, &mut report);
    }
    Ok(Rendered {
        png: drawing.png,
        svg: svg::svg(&content, (&flat.page, &flat.groups), drawing.bare_png.as_deref(), &artist.colors),
        pdf: pdf.transpose()?,
        exr: layers.as_ref().map(|layers| layers.file(blocks)).transpose()?,
        global_view_png: artist.draw(&global, |_, _| ())?.png,
        turn_deg: flat.scene.turn_deg,
        report,
    })
}

/// How often the cones may cover a picture: organs at their true widths reach 0.2 to 1.2, and each further layer costs as
/// much time as such a picture.
const MAX_LAYERS: f64 = 4.0;

/// Whether edges can pass in front of each other.
#[derive(Clone, Copy)]
enum Depth {
    /// Never; what points to the right and up on the whole, if the tree tells.
    Flat { axes: Option<[DVec3; 2]> },
    /// Seen along a direction; what points to the right and up.
    Spatial { axes: [DVec3; 2] },
}

impl Depth {
    /// What names the letters at the edges.
    fn axes(self) -> Option<[DVec3; 2]> {
        match self {
            Self::Flat { axes } => axes,
            Self::Spatial { axes } => Some(axes),
        }
    }
}

/// All that makes a picture but its pixels.
struct Sheet {
    scene: Scene,
    page: Page,
    groups: Vec<drawing::Group>,
    kinship: Kinship,
    drawn: Vec<Drawn>,
    has_depth: bool,
    /// How often the cones would have covered the picture, if that is too often.
    too_thick: Option<f64>,
}

/// A picture, drawn.
struct Drawing<T> {
    png: Vec<u8>,
    /// The tree without the marks, packed, for flat pixels in a PDF.
    stream: Option<Vec<u8>>,
    /// The same as PNG, for a scan in an SVG.
    bare_png: Option<Vec<u8>>,
    /// What was made of each band.
    seen: Vec<T>,
}

/// What the map and the global view have in common.
#[derive(Clone)]
struct Artist<'a> {
    tree: &'a Tree,
    branches: &'a Branches,
    coloring: &'a Coloring,
    params: &'a Params,
    face: &'a Face,
    colors: PageColors,
}

impl Artist<'_> {
    /// The map, turned to fit its page if that is wanted.
    fn turned(&self, scene: Scene, said: &Heading) -> Result<Scene, Error> {
        if self.params.fit == Fit::Upright {
            return Ok(scene);
        }
        let (_, heading_px) = furniture::heading(self.face, said, self.params.width_px, &self.colors);
        let pen = Pen { min_width_px: self.params.min_width_px, style: self.params.style };
        let needs = self.needs(heading_px, true, self.params.aspect);
        let room = self.room(&scene, pen.style);
        Ok(scene.turned(Page::best_turn(&room, (self.params.width_px, pen), &needs)?))
    }

    /// What the tree takes of the page: a scan goes on beyond its walls.
    fn room(&self, scene: &Scene, style: Style) -> Scene {
        let volume = &self.params.volume;
        if style == Style::Volume {
            scene.reaching(|radius_mm| volume.reach(radius_mm))
        } else {
            scene.clone()
        }
    }

    /// The room that marks need; `has_letters` at the edges.
    fn needs(&self, heading_px: f64, has_letters: bool, aspect: Option<f64>) -> Needs {
        let width = self.params.width_px;
        Needs {
            heading_px,
            key_px: furniture::key_size(self.face, self.coloring, width),
            rim_px: Page::unit_px(width) * if has_letters { 4.2 } else { 2.2 },
            aspect,
        }
    }

    /// The sheet in the style asked for; as lines of a tree without radii if those cover the picture too often.
    fn sheet(&self, scene: Scene, said: Heading, depth: Depth) -> Result<Sheet, Error> {
        let true_to_width = self.sheet_as(self.params.style, scene, &said, depth)?;
        let Some(n_layers) = true_to_width.too_thick else { return Ok(true_to_width) };
        let said = heading::without_widths(said);
        let lines = self.sheet_as(Style::Line, true_to_width.scene.without_radii(), &said, depth)?;
        Ok(Sheet { too_thick: Some(n_layers), ..lines })
    }

    fn sheet_as(&self, style: Style, scene: Scene, said: &Heading, depth: Depth) -> Result<Sheet, Error> {
        let (page, groups) = self.lay_out(&self.room(&scene, style), said, (style, depth))?;
        let kinship = Kinship::new(self.tree, self.branches, &scene, page.px_per_mm);
        let sketched = |style| {
            let page = Page { pen: Pen { style, ..page.pen }, ..page };
            sketch::edges(self.tree, &scene, &page, self.coloring, &kinship)
        };
        // Lines too are laid out with room for the radii, which leaves none for the lines.
        let surface = sketched(Style::PseudoSurface);
        let n_layers = raster::layers([page.width as usize, page.height as usize], &surface);
        let drawn = if style == Style::Line { sketched(style) } else { surface };
        let too_thick = (n_layers > MAX_LAYERS).then_some(n_layers);
        let has_depth = matches!(depth, Depth::Spatial { .. });
        Ok(Sheet { scene, page, groups, kinship, drawn, has_depth, too_thick })
    }

    /// The page of a scene and all its marks.
    fn lay_out(
        &self,
        scene: &Scene,
        said: &Heading,
        (style, depth): (Style, Depth),
    ) -> Result<(Page, Vec<drawing::Group>), Error> {
        let Self { tree, coloring, params, face, colors, .. } = self;
        let (heading, heading_px) = furniture::heading(face, said, params.width_px, colors);
        // Thumbnails have no room for letters on a map, whose marks say little without the heading.
        let axes = depth.axes().filter(|_| {
            let is_map = matches!(depth, Depth::Flat { .. });
            params.compass != Compass::None && !(is_map && Page::is_thumbnail(params.width_px))
        });
        let aspect = params.aspect.filter(|_| matches!(depth, Depth::Flat { .. }));
        let needs = self.needs(heading_px, axes.is_some(), aspect);
        let pen = Pen { min_width_px: params.min_width_px, style };
        let page = Page::lay_out(tree, scene, (params.width_px, pen), &needs)?;
        let mut groups = vec![heading];
        groups.extend(furniture::key(&page, coloring, params, colors));
        groups.push(furniture::root_mark(&page, tree, scene, colors));
        groups.extend(axes.and_then(|axes| furniture::compass(&page, axes, params.compass, colors)));
        if let (Depth::Flat { .. }, Some(axes)) = (depth, axes) {
            let map = letters::Map { tree, branches: self.branches, scene, page: &page, axes };
            let taken: Vec<_> =
                groups.iter().flat_map(|group| &group.marks).map(|mark| mark.bounds(face)).collect();
            groups.push(letters::at_branches(&map, (face, colors), params.compass, &taken));
        }
        Ok((page, groups))
    }

    /// The picture, and what `look` makes of each band of its pixels, of which it is told the first row.
    fn draw<T: Send>(
        &self,
        sheet: &Sheet,
        look: impl Fn(usize, &[Pixel]) -> T + Sync,
    ) -> Result<Drawing<T>, Error> {
        let Page { width, height, pen, .. } = sheet.page;
        let raster = Raster::new(Job {
            size: [width as usize, height as usize],
            drawn: &sheet.drawn,
            kinship: &sheet.kinship,
            palette: &self.coloring.palette,
            colors: self.colors,
            style: pen.style,
            has_depth: sheet.has_depth,
        });
        let mut canvas = Canvas::new([width, height], self.colors.background)?;
        let seen = canvas.surface(&raster, [0, 0], look);
        let is_pixels = pen.style.is_pixels();
        let stream = (self.params.pdf && !sheet.has_depth)
            .then(|| if is_pixels { canvas.stream() } else { Vec::new() });
        canvas.mark(&sheet.groups, self.face);
        Ok(Drawing { png: canvas.png(), stream, bare_png: None, seen })
    }

    /// The picture of a scan, and what `look` makes of each band of it, of which it is told the first row.
    fn draw_scan<T: Send>(
        &self,
        sheet: &Sheet,
        reformation: &Reformation<'_>,
        look: impl Fn(usize, &reformation::Band) -> T + Sync,
    ) -> Result<(Drawing<T>, Tally), Error> {
        let paper = Paper::new(&sheet.page, sheet.scene.turn_deg);
        let on_page = reformation.on(&paper);
        let mut canvas = Canvas::new([sheet.page.width, sheet.page.height], self.colors.background)?;
        let draw = |_: &mut (), index: usize| {
            let (band, tally) = on_page.band(index);
            let seen = look(index * raster::TILE, &band);
            (band.pixels, (seen, tally))
        };
        let (seen, tallies): (Vec<T>, Vec<Tally>) =
            canvas.bands((sheet.page.size(), [0, 0]), || (), draw).into_iter().unzip();
        let stream = self.params.pdf.then(|| canvas.stream());
        let bare_png = Some(canvas.png());
        canvas.mark(&sheet.groups, self.face);
        let tally = tallies.into_iter().fold(Tally::default(), Tally::and);
        Ok((Drawing { png: canvas.png(), stream, bare_png, seen }, tally))
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

fn report(tree: &Tree, [map, global]: [&Sheet; 2], n_covered: usize) -> Report {
    let Sheet { scene, page, .. } = map;
    let mut report = Report::default();
    report.count("width_px", page.width);
    report.count("height_px", page.height);
    report.count("mm_per_px", 1.0 / page.px_per_mm);
    let is_thin =
        |&(node, _): &(usize, usize)| scene.radii_mm[node] * page.px_per_mm < 0.5 * page.pen.min_width_px;
    report.count_usize("edges", tree.n_nodes() - 1);
    report.count_usize("edges_at_least_width", tree.edges().filter(is_thin).count());
    let n_pixels = f64::from(page.width) * f64::from(page.height);
    report.count("covered_percent", 100.0 * n_covered as f64 / n_pixels.max(1.0));
    for (sheet, name) in [(map, "map"), (global, "global view")] {
        if let Some(n_layers) = sheet.too_thick {
            report.warn(
                "W-RENDER-THICK",
                format!(
                    "the {name} is drawn as lines: with their radii the edges would cover it about {n_layers:.1} \
                     times over; if the radii are in another unit, set input.radius_scale or render.width_scale"
                ),
            );
        }
    }
    report
}
