//! Thinning: a mask in, the voxels of its curve skeleton out.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 1 | `lattice` | crop the mask to its foreground, pad it with background |
//! | 2 | `topology` | components and Euler number, before and after, for the report |
//! | 3 | `euler`, `simple` | what a voxel's 26 neighbours say: end point, Euler invariance, simplicity |
//! | 4 | `open` | the voxels that may have become deletable |
//! | 5 | `thinning` | peel border voxels from six sides until nothing changes (`lee94`) |
//! | 6 | `rough` | take the bumps of rough walls away (`safe`) |
//! | 7 | `depth`, `safe` | peel level by level of depth in mm, with tips that hold (`safe`) |
//! | 8 | `tips` | move tips to where they belong (`safe`) |
//! | 9 | `restore` | bring back the branches that are missing (`safe`) |
//!
//! Connectivity is 26 for the foreground and 6 for the background throughout. Thinning settles ties by storage order, so
//! masks should come with their axes towards right, anterior, superior, as the stage before hands them on.
//!
//! ```
//! use espalier_model::{Grid, Mask};
//! use espalier_skeleton::{Params, skeletonize};
//! let grid = Grid::axis_aligned([20, 3, 3], glam::DVec3::ONE, glam::DVec3::ZERO)?;
//! let bar = Mask::from_voxels(grid.clone(), &[true; 180]);
//! let thinned = skeletonize(&bar, &Params::default())?;
//! assert!(thinned.skeleton.voxels().iter().all(|&[_, y, z]| (y, z) == (1, 1)));
//! assert!(skeletonize(&Mask::empty(grid), &Params::default()).is_err());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
mod params;

mod depth;
mod euler;
mod lattice;
mod open;
mod restore;
mod rough;
mod safe;
mod simple;
mod thinning;
mod tips;
mod topology;

use espalier_model::{Mask, Report, Skeleton};

pub use error::Error;
pub use params::{Params, Thinning};

use lattice::Lattice;
use simple::is_endpoint;

/// A curve skeleton and what its making did.
#[derive(Clone, Debug, PartialEq)]
pub struct Skeletonized {
    /// The skeleton's voxels, in the mask's own grid.
    pub skeleton: Skeleton,
    /// Counts `foreground_voxels`, `skeleton_voxels`, `sweeps`, `skeleton_endpoints`, `mask_components`,
    /// `skeleton_components`, `mask_euler_number`, `skeleton_euler_number`; a warning if the topology changed.
    pub report: Report,
}

/// The curve skeleton of `mask`.
///
/// # Errors
/// [`Error::EmptyMask`] if there is no foreground.
pub fn skeletonize(mask: &Mask, params: &Params) -> Result<Skeletonized, Error> {
    let mut lattice = Lattice::from_mask(mask).ok_or(Error::EmptyMask)?;
    let mut report = Report::default();
    let mask_topology = topology::measure(lattice.bits());
    report.count_usize("foreground_voxels", lattice.bits().count());

    let n_sweeps = thinning::thin(&mut lattice, params.thinning);

    let skeleton_topology = topology::measure(lattice.bits());
    let n_endpoints = lattice.foreground().filter(|&cell| is_endpoint(lattice.neighborhood(cell))).count();
    let skeleton = Skeleton::new(mask.grid().clone(), lattice.mask_voxels());
    report.count_usize("skeleton_voxels", skeleton.voxels().len());
    report.count_usize("sweeps", n_sweeps);
    report.count_usize("skeleton_endpoints", n_endpoints);
    topology::compare(&mask_topology, &skeleton_topology, &mut report);
    Ok(Skeletonized { skeleton, report })
}
