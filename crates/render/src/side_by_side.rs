//! The layouts of several methods beside the tree in space, in one figure.
//!
//! **Input** for each tree its global view and the layouts of its methods. **Output** PNG and SVG.
//! **Files** `panel`: what stands around each tree.
//! **Steps** 1. Each tree is a section: its view in space, then its layouts, tiled in rows at one scale. 2. Main
//! subtrees have the same colours in every panel. 3. Crossings get rings; of a cluster, as many as do not hide it.
//! 4. Below each panel its row of the table in short; what is best among the section's layouts without crossings is
//! set bold. 5. Scale bar and key end a section.
//! **Guarantees** the same bytes for any number of threads. Where radii would cover a panel several times over, the
//! section shows lines.
//! **Source** figures of section 5 of [Hu2022]. **Cost** that of as many small pictures.

mod panel;

use espalier_model::{Branches, MethodRow, Tree, View};
use glam::DVec2;

use panel::SIDE;

use crate::coloring::Coloring;
use crate::drawing::{Group, Mark};
use crate::furniture::{self, Heading};
use crate::kinship::Kinship;
use crate::page::{MAX_PIXELS, Page, Pen};
use crate::paint::Canvas;
use crate::palette::PageColors;
use crate::params::{Compass, Params, Style};
use crate::raster::{self, Drawn, Job, Raster};
use crate::scene::Scene;
use crate::sheet::MAX_LAYERS;
use crate::text::{Anchor, Face};
use crate::tiling::{Room, Tiling};
use crate::{Error, parts, sketch, svg};

/// Sizes in layout units: font sizes of panel titles and notes, the least panel, the space between panels.
const TITLE: f64 = 1.5;
const NOTE: f64 = 1.12;
const LEAST_PANEL: f64 = 21.0;
const GAP: f64 = 2.2;
/// Space around a tree in its panel, in layout units.
const RIM: f64 = 2.2;
/// Line height over font size.
const LEADING: f64 = 1.4;
/// Height of the key below a section, in layout units.
const KEY: f64 = 5.0;
/// Height of all panels over the width of the page: a figure as wide as a screen.
const MOST_HEIGHT: f64 = 0.75;
/// The same of each tree where there are several.
const SECTION_HEIGHT: f64 = 0.55;
/// Edges in small panels are at least this share of `min_width_px` wide.
const PANEL_PEN: f64 = 0.7;
/// Lines of notes below a panel.
const N_NOTES: usize = 5;

/// A tree with the layouts of its methods.
#[derive(Clone, Debug)]
pub struct Section<'a> {
    /// What to call it, if there are several.
    pub name: Option<&'a str>,
    /// The tree.
    pub tree: &'a Tree,
    /// Its global view.
    pub view: &'a View,
    /// Letters at the edges of the view.
    pub compass: Compass,
    /// The layouts, in the order in which they are shown.
    pub panels: Vec<Panel<'a>>,
}

/// A method's layout.
#[derive(Clone, Debug)]
pub struct Panel<'a> {
    /// Its row of the table.
    pub row: &'a MethodRow,
    /// Where each node lies, plane mm.
    pub positions_mm: &'a [DVec2],
    /// Pairs of edges that cross, each by its lower node.
    pub crossings: Vec<(usize, usize)>,
    /// Whether it became the embedding.
    pub is_chosen: bool,
}

/// The figure.
#[derive(Clone, Debug, PartialEq)]
pub struct SideBySide {
    /// As PNG, sRGB, 8 bits.
    pub png: Vec<u8>,
    /// As SVG; ids of branches begin with the panel's number.
    pub svg: String,
}

/// Draws trees, each in space and by the layouts of its methods.
///
/// # Errors
/// [`Error`] if a parameter is out of range, a layout is another tree's, a number cannot be drawn, or the figure would
/// be over 2²⁷ pixels.
pub fn side_by_side(sections: &[Section<'_>], params: &Params) -> Result<SideBySide, Error> {
    params.validate()?;
    let params = &params.without_scan();
    let artist = Artist { params, face: Face::built_in()?, colors: PageColors::of(params.theme) };
    let sheet = artist.lay_out(sections)?;
    let (width, height) = (params.width_px, sheet.height_px as u32);
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(Error::TooLarge { width, height, limit: MAX_PIXELS });
    }
    let mut canvas = Canvas::new([width, height], artist.colors.background)?;
    for frame in &sheet.frames {
        artist.draw(frame, &mut canvas);
    }
    canvas.mark(&sheet.groups, &artist.face);
    let prefixes: Vec<String> =
        (0..sheet.frames.len()).map(|panel_idx| format!("panel-{panel_idx}-")).collect();
    let title = params.title.as_deref().unwrap_or("methods side by side");
    let trees = sheet.frames.iter().zip(&prefixes);
    let items: Vec<svg::Item<'_>> = trees.map(|(frame, prefix)| frame_item(frame, prefix, title)).collect();
    let svg = svg::figure(("compare", title), (&items, &sheet.groups), ([width, height], &artist.colors));
    Ok(SideBySide { png: canvas.png(), svg })
}

/// The tree of a panel.
fn frame_item<'a>(frame: &'a Frame<'_>, prefix: &'a str, title: &'a str) -> svg::Item<'a> {
    let content = svg::Content {
        tree: frame.tree,
        branches: &frame.branches,
        scene: &frame.scene,
        coloring: &frame.coloring,
        title,
        prefix,
    };
    svg::Item::Tree(content, &frame.page)
}

/// A panel in its place.
struct Frame<'a> {
    tree: &'a Tree,
    branches: std::rc::Rc<Branches>,
    coloring: std::rc::Rc<Coloring>,
    scene: Scene,
    /// The page as the whole figure sees it: `area` is the panel's.
    page: Page,
    has_depth: bool,
}

/// The figure, laid out.
struct Sheet<'a> {
    frames: Vec<Frame<'a>>,
    groups: Vec<Group>,
    height_px: f64,
}

struct Artist<'a> {
    params: &'a Params,
    face: Face,
    colors: PageColors,
}

impl Artist<'_> {
    fn unit_px(&self) -> f64 {
        Page::unit_px(self.params.width_px)
    }

    fn margin_px(&self) -> f64 {
        Page::margin_px(self.params.width_px)
    }

    /// A page whose tree has this area and scale.
    fn page(&self, low: DVec2, high: DVec2, px_per_mm: f64) -> Page {
        Page {
            width: self.params.width_px,
            height: 0,
            unit_px: self.unit_px(),
            px_per_mm,
            origin_px: low,
            area: [low, high],
            key_at: low,
            pen: Pen { min_width_px: PANEL_PEN * self.params.min_width_px, style: self.params.style },
        }
    }

    fn lay_out<'t>(&self, sections: &[Section<'t>]) -> Result<Sheet<'t>, Error> {
        let said = Heading {
            title: self.params.title.clone(),
            verdict: vec![match sections {
                [_, _, ..] => "methods side by side; each tree at one scale, scored by one energy".to_owned(),
                _ => "methods side by side, all at one scale and scored by one energy".to_owned(),
            }],
            facts: Vec::new(),
        };
        let (group, heading_px) = furniture::heading(&self.face, &said, self.params.width_px, &self.colors);
        let mut sheet =
            Sheet { frames: Vec::new(), groups: vec![group], height_px: self.margin_px() + heading_px };
        let share = if sections.len() > 1 { SECTION_HEIGHT } else { MOST_HEIGHT };
        for section in sections {
            self.lay_out_section(section, share, &mut sheet)?;
        }
        sheet.height_px += self.margin_px();
        Ok(sheet)
    }

    /// Adds a section; `share` of the page's width is the height that its panels may have.
    fn lay_out_section<'t>(
        &self,
        section: &Section<'t>,
        share: f64,
        sheet: &mut Sheet<'t>,
    ) -> Result<(), Error> {
        let unit = self.unit_px();
        sheet.height_px += unit;
        if let Some(name) = section.name {
            sheet.height_px += LEADING * TITLE * unit;
            let at = DVec2::new(self.margin_px(), sheet.height_px);
            let name = self.text(at, TITLE, self.colors.ink, name);
            sheet.groups.push(Group { name: "section", marks: vec![strong(name)] });
            sheet.height_px += 0.8 * unit;
        }
        let scenes = self.scenes(section)?;
        let sizes_mm: Vec<DVec2> =
            scenes.iter().map(Scene::bounds_mm).map(|(low, high)| high - low).collect();
        let room = Room {
            width_px: f64::from(self.params.width_px) - 2.0 * self.margin_px(),
            height_px: share * f64::from(self.params.width_px),
            least_px: LEAST_PANEL * unit,
            gap_px: GAP * unit,
            text_px: (LEADING * (TITLE + N_NOTES as f64 * NOTE) + GAP) * unit,
            rim_px: RIM * unit,
            first_px: 2.0 * SIDE * unit,
        };
        let tiling = Tiling::of(&sizes_mm, &room);
        let first_frame = sheet.frames.len();
        let branches = std::rc::Rc::new(section.tree.branches());
        let coloring = std::rc::Rc::new(parts::color(section.tree, &branches, self.params.theme));
        let mut scenes = scenes.into_iter().enumerate();
        for row_mm in sizes_mm.chunks(tiling.n_columns) {
            let row_px = tiling.row_px(row_mm, &room);
            let top = sheet.height_px + LEADING * TITLE * unit;
            for (column, (panel_idx, scene)) in scenes.by_ref().take(row_mm.len()).enumerate() {
                let left = self.margin_px() + column as f64 * (tiling.panel_px + room.gap_px);
                let low = DVec2::new(left, top).floor();
                let page = self.panel_page(&scene, low, DVec2::new(tiling.panel_px, row_px), &tiling);
                let (tree, has_depth) = (section.tree, panel_idx == 0);
                let frame = Frame {
                    tree,
                    branches: branches.clone(),
                    coloring: coloring.clone(),
                    scene,
                    page,
                    has_depth,
                };
                sheet.groups.push(self.panel_marks(section, &frame, panel_idx));
                sheet.frames.push(frame);
            }
            sheet.height_px += row_px + room.text_px;
        }
        self.thin_if_needed(&mut sheet.frames[first_frame..]);
        if let Some(first) = sheet.frames.get(first_frame) {
            let at = DVec2::new(self.margin_px(), sheet.height_px - 0.5 * GAP * unit);
            let has_crossings = section.panels.iter().any(|panel| !panel.crossings.is_empty());
            sheet.groups.extend(self.key(&first.page, at, has_crossings));
            sheet.height_px += KEY * unit;
        }
        Ok(())
    }

    /// The tree in space, then its layouts.
    fn scenes(&self, section: &Section<'_>) -> Result<Vec<Scene>, Error> {
        let width_scale = self.params.width_scale;
        let mut scenes = vec![Scene::seen(section.tree, section.view, width_scale)?];
        for panel in &section.panels {
            let (n_entries, n_nodes) = (panel.positions_mm.len(), section.tree.n_nodes());
            if n_entries != n_nodes {
                return Err(Error::Mismatch { what: "positions", n_entries, n_nodes });
            }
            scenes.push(Scene::flat(section.tree, panel.positions_mm, width_scale)?);
        }
        Ok(scenes)
    }

    /// The page of a panel: the tree in the middle of its area.
    fn panel_page(&self, scene: &Scene, low: DVec2, size: DVec2, tiling: &Tiling) -> Page {
        let page = self.page(low, low + size, tiling.px_per_mm);
        let (low_mm, high_mm) = scene.bounds_mm();
        let center_mm = 0.5 * (low_mm + high_mm);
        let center_px = low + 0.5 * size;
        Page { origin_px: center_px - tiling.px_per_mm * DVec2::new(center_mm.x, -center_mm.y), ..page }
    }

    /// All panels of a section become lines if the radii would cover one of them too often.
    fn thin_if_needed(&self, frames: &mut [Frame<'_>]) {
        let is_thick = |frame: &Frame<'_>| {
            let (local, kinship) = (frame.page.panel(), kinship(frame));
            let page = Page { pen: Pen { style: Style::PseudoSurface, ..local.pen }, ..local };
            let drawn = sketch::edges(frame.tree, &frame.scene, &page, &frame.coloring, &kinship);
            raster::layers(page.size(), &drawn) > MAX_LAYERS
        };
        if self.params.style == Style::PseudoSurface && frames.iter().any(is_thick) {
            for frame in frames {
                frame.page.pen.style = Style::Line;
            }
        }
    }

    fn draw(&self, frame: &Frame<'_>, canvas: &mut Canvas) {
        let page = frame.page.panel();
        let kinship = kinship(frame);
        let drawn: Vec<Drawn> = sketch::edges(frame.tree, &frame.scene, &page, &frame.coloring, &kinship);
        let raster = Raster::new(Job {
            size: page.size(),
            drawn: &drawn,
            kinship: &kinship,
            palette: &frame.coloring.palette,
            colors: self.colors,
            style: page.pen.style,
            has_depth: frame.has_depth,
        });
        canvas.surface(&raster, [frame.page.area[0].x as usize, frame.page.area[0].y as usize], |_, _| ());
    }

    /// Scale bar and what the marks mean.
    fn key(&self, page: &Page, at: DVec2, has_crossings: bool) -> Vec<Group> {
        let unit = self.unit_px();
        let mut groups = Vec::new();
        groups.extend(furniture::scale_bar(page, at, self.params, &self.colors));
        let mut texts = vec![
            "same colour = same subtree".to_owned(),
            "bold = best of the layouts without crossings".to_owned(),
        ];
        let mut marks = Vec::new();
        let mut left = at + DVec2::new(14.0 * unit, 2.9 * unit);
        if has_crossings {
            texts.insert(0, "crossing".to_owned());
            marks.push(Mark::Ring {
                center: left + DVec2::new(0.6, -0.4) * unit,
                radius_px: 0.6 * unit,
                width_px: 0.2 * unit,
                color: self.colors.alarm,
            });
            left.x += 1.8 * unit;
        }
        let room = f64::from(self.params.width_px) - self.margin_px() - left.x;
        for (line, text) in self.face.lines(&texts, (NOTE * unit) as f32, room as f32).iter().enumerate() {
            let at = left + DVec2::new(0.0, line as f64 * LEADING * NOTE * unit);
            marks.push(self.text(at, NOTE, self.colors.soft, text));
        }
        groups.push(Group { name: "key", marks });
        groups
    }

    fn text(&self, at: DVec2, size: f64, color: crate::palette::Rgb, text: &str) -> Mark {
        let size_px = size * self.unit_px();
        Mark::Text { at, size_px, anchor: Anchor::Start, is_strong: false, color, text: text.to_owned() }
    }
}

fn strong(mark: Mark) -> Mark {
    match mark {
        Mark::Text { at, size_px, anchor, color, text, .. } => {
            Mark::Text { at, size_px, anchor, is_strong: true, color, text }
        }
        other => other,
    }
}

fn kinship(frame: &Frame<'_>) -> Kinship {
    Kinship::new(frame.tree, &frame.branches, &frame.scene, frame.page.px_per_mm)
}
