//! Phantom trees on several grids, from clean and rough masks and from noisy CT.

use std::error::Error;
use std::fmt::{self, Display};

use espalier_model::{Ledger, Mask, Skeleton, Tree, Volume, Voxels};
use espalier_phantom::{Kind, Params, Phantom};
use espalier_tree::{Built, Root};
use espalier_volume::{Method, Preset};
use glam::DVec3;
use ndarray::Array3;

use super::{Score, score};

/// The grids: spacing along x, y, z.
pub const GRIDS_MM: [[f64; 3]; 5] = [[0.5; 3], [0.8; 3], [1.0; 3], [1.5; 3], [0.7, 0.7, 2.5]];
/// The trees.
pub const KINDS: [Kind; 2] = [Kind::Airway, Kind::Vessel];
/// The share of the surface's voxels that a rough mask flips.
const ROUGHNESS: f64 = 0.15;
/// The most voxels at size 1; a finer grid gets a smaller anatomy.
const MAX_VOXELS: f64 = 1.2e8;
/// About the extent of the larger scene, in mm³.
const SCENE_MM3: f64 = 324.0 * 220.0 * 265.0;

/// Where the mask comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scan {
    /// The voxels whose centre lies in the body.
    Clean,
    /// The same with flipped voxels on its surface.
    Rough,
    /// Region growing in the noisy CT, in the band that the phantom's makers know.
    Ct,
    /// The preset for airways or vessels in the noisy CT: no threshold is given, and of airways no seed.
    Preset,
}

impl Scan {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Clean, Self::Rough, Self::Ct, Self::Preset];

    /// Whether it is a noisy CT.
    #[must_use]
    pub fn is_ct(self) -> bool {
        matches!(self, Self::Ct | Self::Preset)
    }
}

/// One row of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// Airway or vessel.
    pub kind: Kind,
    /// The grid.
    pub spacing_mm: [f64; 3],
    /// Where the mask comes from.
    pub scan: Scan,
    /// Of the phantom's growth, roughness and noise.
    pub seed: u64,
}

impl Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.spacing_mm;
        let name = format!("{} {x}x{y}x{z} {}", self.kind.name(), format!("{:?}", self.scan).to_lowercase());
        write!(f, "{name:<26}")
    }
}

/// A case with what came out of it.
#[derive(Clone, Debug)]
pub struct Measured {
    /// The case.
    pub case: Case,
    /// The mask that was thinned.
    pub mask: Mask,
    /// What the volume stage dropped and mended to get it.
    pub dropped: Ledger,
    /// The skeleton of the mask.
    pub skeleton: Skeleton,
    /// The true tree.
    pub truth: Tree,
    /// The tree found.
    pub built: Built,
    /// Its figures.
    pub score: Score,
}

/// The names of the columns.
pub const HEADING: &str = "phantom                     tips: true found recall precision  off-axis  stray   length  radius: bias    MAE  forks: true found  angle: mean   p95\n\
                           \u{20}                                        (%)      (%)        (voxel)   (%)      (%)        (voxel) (voxel)                    (deg)  (deg)";

impl Display for Measured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let s = &self.score;
        write!(
            f,
            "{} {:10} {:5} {:6.1} {:9.1} {:9.3} {:6.2} {:+8.2} {:+13.3} {:6.3} {:12} {:5} {:12.2} {:5.1}",
            self.case,
            s.n_true_tips,
            s.n_found_tips,
            100.0 * s.recall(),
            100.0 * s.precision(),
            s.off_axis_voxels,
            100.0 * s.stray_share,
            100.0 * s.length_error,
            s.radius_bias_voxels,
            s.radius_mae_voxels,
            s.n_forks[0],
            s.n_forks[1],
            s.angle_error_mean_deg,
            s.angle_error_p95_deg
        )
    }
}

/// Makes a phantom, its mask and its tree, and compares.
///
/// # Errors
/// Those of the stages.
pub fn measure(case: &Case) -> Result<Measured, Box<dyn Error>> {
    let spacing = DVec3::from_array(case.spacing_mm);
    let voxels = SCENE_MM3 / spacing.element_product();
    let size = espalier_geom::math::cbrt(MAX_VOXELS / voxels).min(1.0);
    let roughness = if case.scan == Scan::Rough { ROUGHNESS } else { 0.0 };
    let params = Params { spacing_mm: case.spacing_mm, size, roughness, ..Params::default() };
    let phantom = espalier_phantom::generate(case.kind, &params, case.seed)?;
    let Masked { mask, dropped, ct } = mask_of(case, &phantom, &params)?;
    let (skeleton, built) = skeleton_and_tree(
        (&mask, ct.as_ref()),
        if case.kind == Kind::Airway { Root::Superior } else { Root::ThickestTip },
    )?;
    let score = score(&phantom.tree, &built.tree, spacing);
    Ok(Measured { case: *case, mask, dropped, skeleton, truth: phantom.tree, built, score })
}

/// A mask as the volume stage hands it on, its part of the ledger, and the scan, if its intensities have made the mask.
struct Masked {
    mask: Mask,
    dropped: Ledger,
    ct: Option<Volume>,
}

fn mask_of(case: &Case, phantom: &Phantom, params: &Params) -> Result<Masked, Box<dyn Error>> {
    if let (true, Some(how)) = (case.scan.is_ct(), phantom.truth.segmentation) {
        let ct = espalier_phantom::ct(phantom, params, case.seed)?;
        let (is_band, is_airway) = (case.scan == Scan::Ct, case.kind == Kind::Airway);
        let volume = espalier_volume::Params {
            method: if is_band { Method::RegionGrow } else { Method::Auto },
            preset: (!is_band).then_some(if is_airway { Preset::Airway } else { Preset::Vessel }),
            lower: is_band.then_some(how.band_hu[0]),
            upper: is_band.then_some(how.band_hu[1]),
            seed_mm: (is_band || !is_airway).then(|| how.seed_mm.to_array()),
            ..espalier_volume::Params::default()
        };
        let segmented = espalier_volume::segment(&ct, &volume)?;
        return Ok(Masked { mask: segmented.mask, dropped: segmented.ledger, ct: Some(ct) });
    }
    let mask = phantom.mask.as_ref().ok_or("a phantom without a mask")?;
    let (mask, dropped) = cleaned(mask)?;
    Ok(Masked { mask, dropped, ct: None })
}

/// Components and cavities of a mask as the volume stage leaves them.
fn cleaned(mask: &Mask) -> Result<(Mask, Ledger), Box<dyn Error>> {
    let [nx, ny, nz] = mask.grid().shape();
    let mut voxels = Array3::zeros((nz, ny, nx));
    for [x, y, z] in mask.voxels() {
        voxels[[z, y, x]] = 1;
    }
    let volume = Volume::new(mask.grid().clone(), Voxels::U8(voxels), 1.0, 0.0);
    let params = espalier_volume::Params { method: Method::Mask, ..espalier_volume::Params::default() };
    let segmented = espalier_volume::segment(&volume, &params)?;
    Ok((segmented.mask, segmented.ledger))
}

/// The tree of a mask with the defaults of all stages.
///
/// # Errors
/// Those of the stages.
pub fn tree_of(mask: &Mask, root: Root) -> Result<Built, Box<dyn Error>> {
    Ok(skeleton_and_tree((mask, None), root)?.1)
}

fn skeleton_and_tree(
    (mask, scan): (&Mask, Option<&Volume>),
    root: Root,
) -> Result<(Skeleton, Built), Box<dyn Error>> {
    let skeleton = espalier_skeleton::skeletonize(mask, &espalier_skeleton::Params::default())?.skeleton;
    let params = espalier_radius::Params::default();
    let mut spheres = espalier_radius::inscribed_spheres(mask, &skeleton, &params)?.spheres;
    if let Some(scan) = scan {
        spheres = espalier_radius::walls((mask, &skeleton), &spheres, scan, &params)?.spheres;
    }
    let params = espalier_tree::Params { root, ..espalier_tree::Params::default() };
    let built = espalier_tree::build(mask, &skeleton, &spheres, &params)?;
    Ok((skeleton, built))
}
