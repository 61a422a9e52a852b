//! Which tips were found, by how thick they are: what a grid cannot show, no method finds.

use espalier_geom::math::cbrt;
use espalier_tests::ground_truth::{free_ends, lost_tips, phantoms::Measured};

/// The upper ends of the bands of diameter, in voxels; the last has none.
const BANDS_VOXELS: [f64; 5] = [1.5, 2.0, 3.0, 4.0, f64::INFINITY];

/// One line: for each band of true diameters at the tips, how many of them were found.
pub(crate) fn print(measured: &Measured) {
    let (truth, spacing_mm) = (&measured.truth, glam::DVec3::from_array(measured.case.spacing_mm));
    let voxel_mm = cbrt(spacing_mm.element_product());
    let diameter = |tip: usize| 2.0 * truth.nodes()[tip].radius_mm / voxel_mm;
    let (tips, lost) = (free_ends(truth), lost_tips(truth, &measured.built.tree, spacing_mm));
    let mut from = 0.0;
    let mut bands = Vec::new();
    for to in BANDS_VOXELS {
        let n_in = |tips: &[usize]| tips.iter().filter(|&&tip| (from..to).contains(&diameter(tip))).count();
        let (n_true, n_lost) = (n_in(&tips), n_in(&lost));
        if n_true > 0 {
            let range = if to.is_finite() { format!("{from}–{to}") } else { format!("over {from}") };
            bands.push(format!("{range}: {} of {n_true}", n_true - n_lost));
        }
        from = to;
    }
    println!("    found by diameter at the tip in voxels: {}", bands.join(", "));
}
