//! [`Volume`] → [`Mask`].
//!
//! **Input** a volume and [`Params`]. **Output** [`Segmented`].
//! **Steps** 1. choose the organ's voxels by value, or by growing from a seed; 2. drop all but the largest
//! components; 3. fill cavities.
//! **Guarantees** the mask has at least one voxel, and the volume's grid; every step's effect is in the report.

use espalier_model::{Grid, Ledger, Mask, Report, Volume};

use crate::kind::Census;
use crate::runs::Runs;
use crate::select::{Selection, select};
use crate::{Error, Params, cavities, components};

/// A mask, and what was done to get it.
#[derive(Clone, Debug, PartialEq)]
pub struct Segmented {
    /// The organ.
    pub mask: Mask,
    /// An entry for each component that was dropped, largest first; beyond 200 one entry for all others.
    pub ledger: Ledger,
    /// Counts `selected_voxels`, `selected_ml`, `components`, `components_dropped`, `components_dropped_voxels`,
    /// `component_largest_voxels`, `component_dropped_largest_voxels`, `cavities_filled`,
    /// `cavities_filled_voxels`, `foreground_voxels`, `foreground_ml`.
    pub report: Report,
}

/// Makes a mask of a volume.
///
/// ```
/// use espalier_model::{Grid, Volume, Voxels};
/// use espalier_volume::{Method, Params, segment};
/// let grid = Grid::axis_aligned([4, 1, 1], glam::DVec3::ONE, glam::DVec3::ZERO).unwrap();
/// let ct = Volume::new(grid, Voxels::I16(ndarray::arr3(&[[[-1000_i16, -990, 40, 55]]])), 1.0, 0.0);
/// let params = Params { method: Method::Threshold, upper: Some(-900.0), ..Params::default() };
/// assert_eq!(segment(&ct, &params).unwrap().mask.n_foreground(), 2);
/// assert!(segment(&ct, &Params::default()).is_err()); // a CT: the method must be given
/// ```
///
/// # Errors
/// [`Error`] for parameters out of range, a volume that needs a method, a seed outside the volume or the band,
/// and for a choice without any voxel.
pub fn segment(volume: &Volume, params: &Params) -> Result<Segmented, Error> {
    params.validate()?;
    let selection = select(volume, params)?;
    segment_selection(selection, volume.grid(), params, || {
        let mut census = Census::default();
        volume.for_each_value(|value| census.see(value));
        Ok((census.min, census.max))
    })
}

/// What [`segment`] does once the voxels are chosen. `range` tells the smallest and the largest finite value, for a
/// message.
pub(crate) fn segment_selection(
    selection: Selection,
    grid: &Grid,
    params: &Params,
    range: impl FnOnce() -> Result<(f64, f64), Error>,
) -> Result<Segmented, Error> {
    let mut report = Report::default();
    let n_selected = selection.bits.count();
    if n_selected == 0 {
        let (min, max) = range()?;
        return Err(Error::Empty { what: selection.what, min, max });
    }
    if n_selected == grid.n_voxels() {
        report.warn("W-VOLUME-FULL", format!("{} holds every voxel of the volume", selection.what));
    }
    let cleaned = clean(Mask::new(grid.clone(), selection.bits), params)?;
    report.extend(cleaned.report);
    Ok(Segmented { report, ..cleaned })
}

/// Cleans a mask: of the parameters, all that do not choose voxels.
///
/// # Errors
/// [`Error`] for parameters out of range, and for a mask of which nothing is left.
pub fn clean(mask: Mask, params: &Params) -> Result<Segmented, Error> {
    params.validate()?;
    let mut report = Report::default();
    let grid = mask.grid().clone();
    let millilitres = |n_voxels: usize| n_voxels as f64 * grid.voxel_volume_mm3() / 1000.0;
    let mut bits = mask.into_bits();
    let n_selected = bits.count();
    report.count_usize("selected_voxels", n_selected);
    report.count("selected_ml", millilitres(n_selected));

    // Drop all but the largest components.
    let runs = Runs::cut(&bits);
    let (ledger, n_dropped) = components::keep(&mut bits, &runs, &grid, params, &mut report);
    let runs = if n_dropped > 0 { Runs::cut(&bits) } else { runs };

    // Fill cavities.
    if params.fill_cavities {
        let cavities = cavities::find(&runs, grid.shape());
        cavities::fill(&mut bits, &cavities);
        report.count_usize("cavities_filled", cavities.n_cavities);
        report.count_usize("cavities_filled_voxels", cavities.n_voxels);
    }
    let mask = Mask::new(grid.clone(), bits);
    let n_foreground = mask.n_foreground();
    if n_foreground == 0 {
        let what = "the mask after cleaning".to_owned();
        return Err(Error::Empty { what, min: 0.0, max: 1.0 });
    }
    report.count_usize("foreground_voxels", n_foreground);
    report.count("foreground_ml", millilitres(n_foreground));
    Ok(Segmented { mask, ledger, report })
}
