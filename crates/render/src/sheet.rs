//! A picture of a tree, laid out: all that makes it but its pixels.
//!
//! **Input** a scene, what the heading says, colours. **Output** the page with its marks and cones; then the pixels, drawn
//! band by band.
//! **Steps** 1. The page. 2. Marks, each where it covers nothing. 3. Cones; lines where radii would cover the page too often.
//! **Cost** that of its parts.

use espalier_model::{Branches, Tree};
use glam::DVec3;

use crate::coloring::Coloring;
use crate::furniture::Heading;
use crate::kinship::Kinship;
use crate::page::{Needs, Page, Paper, Pen};
use crate::paint::Canvas;
use crate::palette::PageColors;
use crate::params::{Compass, Fit, Params, Style};
use crate::raster::{self, Drawn, Job, Pixel, Raster};
use crate::reformation::{Band, Reformation, Tally};
use crate::room::Grid;
use crate::scene::Scene;
use crate::text::Face;
use crate::{Error, drawing, furniture, heading, letters, root_mark, sketch};

/// How often the cones may cover a picture: organs at their true widths reach 0.2 to 1.2, and each further layer costs as
/// much time as such a picture.
pub(crate) const MAX_LAYERS: f64 = 4.0;

/// Whether edges can pass in front of each other.
#[derive(Clone, Copy)]
pub(crate) enum Depth {
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
pub(crate) struct Sheet {
    pub scene: Scene,
    pub page: Page,
    pub groups: Vec<drawing::Group>,
    kinship: Kinship,
    drawn: Vec<Drawn>,
    has_depth: bool,
    /// How often the cones would have covered the picture, if that is too often.
    pub too_thick: Option<f64>,
}

/// A picture, drawn.
pub(crate) struct Drawing<T> {
    pub png: Vec<u8>,
    /// The tree without the marks, packed, for flat pixels in a PDF.
    pub stream: Option<Vec<u8>>,
    /// The same as PNG, for a scan in an SVG.
    pub bare_png: Option<Vec<u8>>,
    /// What was made of each band.
    pub seen: Vec<T>,
}

/// What the map and the global view have in common.
#[derive(Clone)]
pub(crate) struct Artist<'a> {
    pub tree: &'a Tree,
    pub branches: &'a Branches,
    pub coloring: &'a Coloring,
    pub params: &'a Params,
    pub face: &'a Face,
    pub colors: PageColors,
}

impl Artist<'_> {
    /// The map, turned to fit its page if that is wanted.
    pub(crate) fn turned(&self, scene: Scene, said: &Heading) -> Result<Scene, Error> {
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
    pub(crate) fn sheet(&self, scene: Scene, said: Heading, depth: Depth) -> Result<Sheet, Error> {
        let true_to_width = self.sheet_as(self.params.style, scene, &said, depth)?;
        let Some(n_layers) = true_to_width.too_thick else { return Ok(true_to_width) };
        let said = heading::without_widths(said);
        let lines = self.sheet_as(Style::Line, true_to_width.scene.without_radii(), &said, depth)?;
        Ok(Sheet { too_thick: Some(n_layers), ..lines })
    }

    fn sheet_as(&self, style: Style, scene: Scene, said: &Heading, depth: Depth) -> Result<Sheet, Error> {
        let (page, groups) = self.lay_out(&scene, said, (style, depth))?;
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
        // What the tree takes of the page: a scan goes on beyond its walls.
        let reached = &self.room(scene, style);
        let page = Page::lay_out(tree, reached, (params.width_px, pen), &needs)?;
        let mut groups = vec![heading];
        groups.extend(furniture::key(&page, coloring, params, colors));
        groups.extend(axes.and_then(|axes| furniture::compass(&page, axes, params.compass, colors)));
        let mut room = Grid::new([page.width, page.height], page.unit_px);
        room.take_marks(&groups, face);
        room.take_branches(&page, tree, reached);
        groups.push(root_mark::root_mark((&page, &mut room), (tree, scene), (face, colors)));
        if let (Depth::Flat { .. }, Some(axes)) = (depth, axes) {
            let map = letters::Map { tree, branches: self.branches, scene: reached, page: &page, axes };
            groups.push(letters::at_branches(&map, &mut room, (face, colors), params.compass));
        }
        Ok((page, groups))
    }

    /// The picture, and what `look` makes of each band of its pixels, of which it is told the first row.
    pub(crate) fn draw<T: Send>(
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
    pub(crate) fn draw_scan<T: Send>(
        &self,
        sheet: &Sheet,
        reformation: &Reformation<'_>,
        look: impl Fn(usize, &Band) -> T + Sync,
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
