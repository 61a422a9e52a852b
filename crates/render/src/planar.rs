//! The map of an embedded tree, and the global view beside it.
//!
//! **Input** a tree with its embedding and views, the scan that it shows if it shows one. **Output** the files.
//! **Steps** 1. Colours, and what the heading says. 2. The sheets of both pictures. 3. The map's pixels, with the blocks of
//! the EXR made of each band of them. 4. The documents, and the global view.
//! **Guarantees** the same bytes for any number of threads.

use espalier_model::{Branches, Embedding, Report, Tree, View, ViewHierarchy, Volume};

use crate::coloring::{self, Coloring};
use crate::layers::Layers;
use crate::map::PlanarMap;
use crate::orientation::Orientation;
use crate::palette::PageColors;
use crate::params::{Params, Style};
use crate::raster::Pixel;
use crate::reformation::{Reformation, Tally};
use crate::scene::Scene;
use crate::sheet::{Artist, Depth, Drawing, Sheet};
use crate::text::Face;
use crate::{Error, Rendered, check_entries, heading, pdf, svg};

/// The map alone as PNG: no other picture or file is made, and the scan of [`Style::Volume`] is not shown.
///
/// # Errors
/// As [`crate::render`].
pub fn planar_png(tree: &Tree, embedding: &Embedding, params: &Params) -> Result<Vec<u8>, Error> {
    let params = &Params { pdf: false, ..params.without_scan() };
    let studio = Studio::new(tree, embedding, params)?;
    let artist = studio.artist(&studio.coloring, params);
    let sheet = studio.map_sheet(&artist, None)?;
    Ok(artist.draw(&sheet, |_, _| ())?.png)
}

/// The map alone as SVG, without any pixels.
///
/// # Errors
/// As [`crate::render`].
pub fn planar_svg(tree: &Tree, embedding: &Embedding, params: &Params) -> Result<String, Error> {
    let params = &params.without_scan();
    let studio = Studio::new(tree, embedding, params)?;
    let artist = studio.artist(&studio.coloring, params);
    let sheet = studio.map_sheet(&artist, None)?;
    Ok(svg::svg(&content(&artist, &sheet), (&sheet.page, &sheet.groups), None, &artist.colors))
}

/// Makes all files.
pub(crate) fn draw_all(
    (tree, embedding, views): (&Tree, &Embedding, &ViewHierarchy),
    scan: Option<&Volume>,
    params: &Params,
) -> Result<Rendered, Error> {
    let studio = Studio::new(tree, embedding, params)?;
    let map = PlanarMap::of(tree, embedding, views);
    let reformation = match (params.style, scan) {
        (Style::Volume, None) => return Err(Error::NoScan),
        (Style::Volume, Some(scan)) => {
            let rule = PageColors::of(params.theme).soft;
            Some(Reformation::new((tree, &map), scan, (&params.volume, rule))?)
        }
        _ => None,
    };
    let own_params = params.without_scan();
    let artist = studio.artist(&studio.coloring, &own_params);
    let greys = reformation.as_ref().map(|reformation| reformation.greys().coloring(tree.n_nodes()));
    let on_map = studio.artist(greys.as_ref().unwrap_or(&studio.coloring), params);
    let flat = studio.map_sheet(&on_map, reformation.as_ref())?;
    let global = studio.global_sheet(&artist, &views.global)?;

    // Radii that nothing can be drawn with leave lines, and no room for a scan.
    let reformation = reformation.filter(|_| flat.page.pen.style == Style::Volume);
    let layers = params.exr.then(|| {
        let on_page = (&flat.page, flat.scene.turn_deg, reformation.is_some());
        Layers::new((tree, &studio.branches), (&map, embedding), &studio.orientation, on_page)
    });
    let (drawing, tally) = pixels(&on_map, &flat, reformation.as_ref(), layers.as_ref())?;
    let n_covered = drawing.seen.iter().map(|(n_covered, _)| n_covered).sum();
    let blocks = drawing.seen.into_iter().flat_map(|(_, blocks)| blocks).collect();
    let content = content(&on_map, &flat);
    let pdf = drawing.stream.map(|stream| {
        let drawn = pdf::Drawn::of(&content, &flat.page, &artist.colors, stream);
        let paper = (artist.colors.background, artist.face);
        pdf::pdf(&flat.page, (drawn, &flat.groups), paper, content.title)
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

/// What both pictures are made with.
struct Studio<'a> {
    tree: &'a Tree,
    embedding: &'a Embedding,
    params: &'a Params,
    branches: Branches,
    /// The map as the embedding has it.
    scene: Scene,
    orientation: Orientation,
    coloring: Coloring,
    face: Face,
}

impl<'a> Studio<'a> {
    fn new(tree: &'a Tree, embedding: &'a Embedding, params: &'a Params) -> Result<Self, Error> {
        params.validate()?;
        check_entries(tree, embedding)?;
        let branches = tree.branches();
        let scene = Scene::planar(tree, embedding, params.drawn_width_scale())?;
        // The losses do not depend on how the whole is turned.
        let orientation = Orientation::of(tree, &scene);
        let coloring = coloring::color((tree, &branches), embedding, &orientation, params);
        let face = Face::built_in()?;
        Ok(Self { tree, embedding, params, branches, scene, orientation, coloring, face })
    }

    fn artist<'s>(&'s self, coloring: &'s Coloring, params: &'s Params) -> Artist<'s> {
        Artist {
            tree: self.tree,
            branches: &self.branches,
            coloring,
            params,
            face: &self.face,
            colors: PageColors::of(params.theme),
        }
    }

    fn map_sheet(&self, artist: &Artist<'_>, scan: Option<&Reformation<'_>>) -> Result<Sheet, Error> {
        let Self { tree, embedding, params, branches, orientation, .. } = self;
        let said = heading::planar((tree, branches), embedding, orientation, params);
        let said = match scan {
            Some(scan) => heading::with_scan(said, scan.greys(), &params.volume),
            None => said,
        };
        let scene = artist.turned(self.scene.clone(), &said)?;
        let axes = Orientation::of(tree, &scene).axes;
        artist.sheet(scene, said, Depth::Flat { axes })
    }

    fn global_sheet(&self, artist: &Artist<'_>, view: &View) -> Result<Sheet, Error> {
        let scene = Scene::seen(self.tree, view, self.params.width_scale)?;
        let said = heading::global(self.tree, &self.branches, view, self.params);
        artist.sheet(scene, said, Depth::Spatial { axes: [view.up.cross(view.towards_camera), view.up] })
    }
}

/// What has come of each band of pixels: how many the tree covers, and the blocks of the EXR.
type Seen = (usize, Vec<Vec<u8>>);

/// The map's pixels, with the scan if there is one to show.
fn pixels(
    artist: &Artist<'_>,
    sheet: &Sheet,
    scan: Option<&Reformation<'_>>,
    layers: Option<&Layers<'_>>,
) -> Result<(Drawing<Seen>, Tally), Error> {
    let blocks = |first_row: usize, pixels: &[Pixel], values: &[f32]| {
        layers.map(|layers| layers.blocks(first_row, pixels, values)).unwrap_or_default()
    };
    let n_covered = |pixels: &[Pixel]| pixels.iter().filter(|pixel| pixel.is_covered()).count();
    match scan {
        Some(scan) => artist.draw_scan(sheet, scan, |first_row, band| {
            (n_covered(&band.pixels), blocks(first_row, &band.pixels, &band.values))
        }),
        None => {
            let look = |first_row, pixels: &[Pixel]| (n_covered(pixels), blocks(first_row, pixels, &[]));
            Ok((artist.draw(sheet, look)?, Tally::default()))
        }
    }
}

fn content<'a>(artist: &Artist<'a>, sheet: &'a Sheet) -> svg::Content<'a> {
    svg::Content {
        tree: artist.tree,
        branches: artist.branches,
        scene: &sheet.scene,
        coloring: artist.coloring,
        title: artist.params.title.as_deref().unwrap_or("planar map of a tree"),
        prefix: "",
    }
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
