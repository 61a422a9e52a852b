//! Pictures of an embedded tree: pseudo-surface or lines, as PNG, SVG and EXR, beside the tree in space.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 0 | `map` | what each point of the plane stands for in the patient |
//! | 1 | `scene` | nodes in picture space: the map, or the global view |
//! | 2 | `coloring`, `branch_names`, `palette`, `unit`, `color_table` | a value for each end of each edge, its colour, its scale |
//! | 3 | `heading`, `furniture`, `room`, `root_mark`, `letters`, `text` | what stands beside the tree, and how much room it needs |
//! | 4 | `page`, `sheet` | scale and places; all that makes a picture but its pixels |
//! | 5 | `sketch`, `cone`, `kinship` | edges as round cones in pixels |
//! | 6 | `raster`, `tiles`, `samples`, `shade` | the pixels |
//! | 7 | `reformation` | the pixels of a scan along the map, in place of 5 and 6 |
//! | 8 | `paint`, `svg`, `outline`, `pdf`, `layers` | the files |
//! | 9 | `planar` | steps 1 to 8 of the map and of the global view |
//! | 10 | `side_by_side`, `tiling`, `parts`; `space`; `juxtaposed`; `chart`, `convergence`, `profile`; `thumbnail` | figures of several layouts, of the organ, of two trees, of numbers; a map among many |
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
mod room;
mod root_mark;
mod text;

mod page;
mod sheet;

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

mod planar;

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

use espalier_model::{Embedding, Report, Tree, ViewHierarchy, Volume};

pub use branch_names::branch_colors;
pub use chart::{Chart, Charts, charts};
pub use color_table::{ColorTable, color_table};
pub use convergence::{Searched, convergence};
pub use error::Error;
pub use juxtaposed::{ChangeOf, juxtaposed};
pub use map::{Beside, Place, PlanarMap, reach};
pub use params::{ColorBy, Compass, Fit, LabelEntry, Labels, Params, SpaceView, Style, Theme, Unit};
pub use planar::{planar_png, planar_svg};
pub use profile::{Stretch, Way, profile};
pub use reformation::params::{Slab, VolumeParams, Window};
pub use side_by_side::{Panel, Section, SideBySide, side_by_side};
pub use space::{MOST_WIDTH as MOST_SPACE_WIDTH, Organ, Subject as SpaceSubject, space};
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
    planar::draw_all((tree, embedding, views), None, params)
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
    planar::draw_all((tree, embedding, views), Some(scan), params)
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
