//! Phantoms: tubes and trees whose truth is known, as trees, masks and CT.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 1 | `tubes` | the closed forms: straight, bent and helical tubes, Y, torus, comb |
//! | 1 | `airway`, `vessel` | a trunk by anatomy, then a tree grown (`growth`, `clearance`) into `lungs` or liver |
//! | 1 | `neuron` | a wandering tree of an exact number of nodes |
//! | 1 | `topology` | grown anew until the mask has no false loop |
//! | 2 | `shape` → `body` | nodes, rounded; the union of round cones about them |
//! | 3 | `raster`, `rough` | the mask: voxels whose centre lies in the body; roughened if asked |
//! | 4 | `tissue`, `scene`, `texture`, `companions` | the CT: partial volume, surroundings, blur, noise |
//!
//! ```
//! use espalier_phantom::{Kind, Params, generate};
//! let phantom = generate(Kind::Straight, &Params::default(), 0)?;
//! assert_eq!(phantom.truth.length_mm, 60.0);
//! assert!(phantom.mask.is_some());
//!
//! let huge = Params { length_mm: 1e5, spacing_mm: [0.1; 3], ..Params::default() };
//! assert!(generate(Kind::Straight, &huge, 0).is_err());
//! # Ok::<(), espalier_phantom::Error>(())
//! ```

mod airway;
mod body;
mod clearance;
mod companions;
mod error;
mod growth;
mod lungs;
mod neuron;
mod params;
mod raster;
mod rough;
mod scene;
mod shape;
mod texture;
mod tissue;
mod topology;
mod truth;
mod tubes;
mod twin;
mod vessel;

use std::sync::Arc;

use espalier_model::{Grid, Mask, Tree, Volume};
use glam::DVec3;

pub use body::Body;
pub use error::Error;
pub use params::{Kind, MAX_NODES, MAX_VOXELS, Params};
pub use truth::{Segmentation, Truth};
pub use twin::{Disease, Growth, twin};

use shape::Shape;

/// A phantom: its ground truth, its mask, and what is known about it.
#[derive(Clone, Debug)]
pub struct Phantom {
    /// What it shows.
    pub kind: Kind,
    /// The ground-truth tree, RAS+ mm; positions and radii are rounded to 0.0001 mm (a neuron's to a nanometre).
    pub tree: Tree,
    /// The voxels whose centre lies in the body or on its surface; `None` for a neuron.
    pub mask: Option<Mask>,
    /// What is known about it.
    pub truth: Truth,
    /// The solid body that the mask shows.
    pub body: Arc<Body>,
    shape: Arc<Shape>,
}

/// Makes a phantom with its tree, mask and truth. Its CT is made by [`ct`].
///
/// # Errors
/// [`Error`] if a parameter is out of its range, or the phantom would exceed a limit.
pub fn generate(kind: Kind, params: &Params, seed: u64) -> Result<Phantom, Error> {
    let (shape, truth) = shape_and_truth(kind, params, seed)?;
    let tree = Tree::new(&shape.nodes)?;
    let body = Body::about(&shape, |radius| radius);
    let mask = match kind {
        Kind::Neuron => None,
        _ => Some(mask_of(&body, scene::bounds(kind), params, seed)?),
    };
    Ok(Phantom { kind, tree, mask, truth, body: Arc::new(body), shape: Arc::new(shape) })
}

/// The ground-truth tree alone: the same as [`generate`]'s, without a volume.
///
/// # Errors
/// As [`generate`], but for the limits of volumes.
pub fn grow_tree(kind: Kind, params: &Params, seed: u64) -> Result<Tree, Error> {
    let (shape, _) = shape_and_truth(kind, params, seed)?;
    Ok(Tree::new(&shape.nodes)?)
}

/// The CT of a phantom on its mask's grid: `i16` HU, made with the parameters of the phantom.
///
/// # Errors
/// [`Error::TreeOnly`] for a neuron; [`Error`] as [`generate`], and if the blur is wider than 16 voxels.
pub fn ct(phantom: &Phantom, params: &Params, seed: u64) -> Result<Volume, Error> {
    tissue::ct(phantom, params, seed)
}

/// The mask of the body about any tree, such as a neuron's, with the spacing, offset, margin and roughness of
/// `params`.
///
/// # Errors
/// [`Error`] if a parameter is out of its range, or the mask would exceed a limit.
pub fn rasterise(tree: &Tree, params: &Params, seed: u64) -> Result<Mask, Error> {
    params.validate()?;
    let shape = Shape { nodes: tree.nodes().to_vec(), closing: Vec::new() };
    mask_of(&Body::about(&shape, |radius| radius), None, params, seed)
}

fn shape_and_truth(kind: Kind, params: &Params, seed: u64) -> Result<(Shape, Truth), Error> {
    params.validate()?;
    let (mut shape, closed_form) = match kind {
        Kind::Airway => (grown(kind, params, |attempt| airway::shape(params, seed, attempt))?, None),
        Kind::Vessel => (grown(kind, params, |attempt| vessel::shape(params, seed, attempt))?, None),
        Kind::Neuron => (neuron::shape(params.n_nodes, seed)?, None),
        _ => tubes::shape(kind, params).map(|(shape, truth)| (shape, Some(truth)))?,
    };
    shape.round(if kind == Kind::Neuron { neuron::QUANTUM_MM } else { shape::QUANTUM_MM });
    let mut truth = match closed_form {
        Some(truth) => truth,
        None => Truth::of_tree(&Tree::new(&shape.nodes)?),
    };
    // A node well inside the trunk: half-way down the trachea, or a step into a tube.
    let seed_node = (if kind == Kind::Airway { 8 } else { 1 }).min(shape.nodes.len() - 1);
    truth.segmentation = (kind != Kind::Neuron).then(|| Segmentation {
        seed_mm: shape.nodes[seed_node].position_mm,
        band_hu: scene::lumen_band(kind),
    });
    Ok((shape, truth))
}

/// A grown tree without false loops, at the size asked for.
fn grown(kind: Kind, params: &Params, grow: impl Fn(u32) -> Shape) -> Result<Shape, Error> {
    let mut shape = topology::first_ball(scene::bounds(kind).unwrap_or_default(), grow)?;
    shape.scale(params.size);
    Ok(shape)
}

/// The mask of a body on a grid about `bounds` (at size 1) or else about the body.
fn mask_of(body: &Body, bounds: Option<(DVec3, DVec3)>, params: &Params, seed: u64) -> Result<Mask, Error> {
    let grid = grid_about(bounds.map(|(low, high)| (low * params.size, high * params.size)), body, params)?;
    let smooth = raster::mask(body, &grid)?;
    Ok(if params.roughness > 0.0 { rough::roughen(&smooth, params.roughness, seed) } else { smooth })
}

/// An axis-aligned grid about a box, or about the body and its margin.
fn grid_about(bounds: Option<(DVec3, DVec3)>, body: &Body, params: &Params) -> Result<Grid, Error> {
    let spacing = DVec3::from_array(params.spacing_mm);
    let (low, high) = bounds.unwrap_or_else(|| {
        let (low, high) = body.bounds();
        let margin = DVec3::splat(params.margin_mm).max(2.0 * spacing);
        (low - margin, high + margin)
    });
    let extents = ((high - low) / spacing).ceil() + 1.0;
    if extents.x * extents.y * extents.z > MAX_VOXELS as f64 {
        return Err(Error::TooManyVoxels { shape: extents.to_array(), limit: MAX_VOXELS });
    }
    let origin = low + spacing * DVec3::from_array(params.offset_voxels);
    let shape = [extents.x as usize, extents.y as usize, extents.z as usize];
    Ok(Grid::axis_aligned(shape, spacing, origin)?)
}
