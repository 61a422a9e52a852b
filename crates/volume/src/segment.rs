//! [`Volume`] → [`Mask`].
//!
//! **Input** a volume and [`Params`]. **Output** [`Segmented`].
//! **Steps** 1. choose the organ's voxels by value, or by growing from a seed; 2. drop all but the largest
//! components; 3. fill cavities; 4. close tunnels that are faults of the mask.
//! **Guarantees** the mask has at least one voxel, and the volume's grid; every step's effect is in the report.

use espalier_model::{Bits, Grid, Ledger, LedgerEntry, Mask, Report, Volume};

use crate::euler::euler_number;
use crate::growth::Growth;
use crate::heal::Healed;
use crate::kind::Census;
use crate::runs::{Connectivity, Runs};
use crate::select::{Selection, select};
use crate::trachea::SeedCandidate;
use crate::{Error, Params, cavities, components, heal};

/// How often places to close tunnels are looked for; on the masks at hand the second pass finds a few, the third
/// none.
const MAX_PASSES: usize = 4;

/// A mask, and what was done to get it.
#[derive(Clone, Debug, PartialEq)]
pub struct Segmented {
    /// The organ.
    pub mask: Mask,
    /// An entry for each component that was dropped, largest first, beyond 200 one for all others; then an entry for
    /// each place at which a tunnel was closed.
    pub ledger: Ledger,
    /// Counts `selected_voxels`, `selected_ml`, `components`, `components_dropped`, `components_dropped_voxels`,
    /// `component_largest_voxels`, `component_dropped_largest_voxels`, `cavities_filled`,
    /// `cavities_filled_voxels`, `tunnels`, `foreground_voxels`, `foreground_ml`. Where tunnels were closed also
    /// `tunnels_left`, `tunnel_repairs`, `tunnel_repairs_filled_voxels`, `tunnel_repairs_cleared_voxels`. Of a region
    /// that grew also `stable_threshold`, `stable_ml`, `leaking_threshold`, `leaking_ml` where it leaks; of a seed
    /// that was found `seed_candidates`, `seed_voxel_x/y/z`, `seed_score`, `seed_score_of_next`.
    pub report: Report,
    /// The volume of a region that grew as a function of the threshold.
    pub growth: Option<Growth>,
    /// Where it could have grown from, the seed first; empty where the seed was given.
    pub seeds: Vec<SeedCandidate>,
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
    let mut report = selection.report;
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
    Ok(Segmented { report, growth: selection.growth, seeds: selection.seeds, ..cleaned })
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
    let (mut ledger, n_dropped) = components::keep(&mut bits, &runs, &grid, params, &mut report);
    let runs = if n_dropped > 0 { Runs::cut(&bits) } else { runs };

    // Fill cavities, and count tunnels, which closed cavities cannot be mistaken for.
    let cavities = cavities::find(&runs, grid.shape());
    let n_components = report.get("components").unwrap_or(0.0) as i64 - n_dropped as i64;
    let n_tunnels = n_components + cavities.n_cavities as i64 - euler_number(&bits);
    if params.fill_cavities {
        cavities::fill(&mut bits, &cavities);
        report.count_usize("cavities_filled", cavities.n_cavities);
        report.count_usize("cavities_filled_voxels", cavities.n_voxels);
    }
    report.count("tunnels", n_tunnels as f64);

    // Close tunnels that are faults of the mask.
    if params.close_tunnels && n_tunnels > 0 {
        ledger.0.extend(close_tunnels(&mut bits, &grid, params, &mut report));
    }
    let mask = Mask::new(grid.clone(), bits);
    let n_foreground = mask.n_foreground();
    if n_foreground == 0 {
        let what = "the mask after cleaning".to_owned();
        return Err(Error::Empty { what, min: 0.0, max: 1.0 });
    }
    report.count_usize("foreground_voxels", n_foreground);
    report.count("foreground_ml", millilitres(n_foreground));
    Ok(Segmented { mask, ledger, report, growth: None, seeds: Vec::new() })
}

/// Closes tunnels, and fills what that may have closed in, until no place is left to be changed.
fn close_tunnels(bits: &mut Bits, grid: &Grid, params: &Params, report: &mut Report) -> Vec<LedgerEntry> {
    let mut all = Healed::default();
    let mut n_left = 0;
    for _ in 0..MAX_PASSES {
        let healed = heal::heal(bits, grid);
        let runs = Runs::cut(bits);
        let cavities = cavities::find(&runs, grid.shape());
        let n_components = runs.components(Connectivity::All).n_components;
        n_left = (n_components + cavities.n_cavities) as i64 - euler_number(bits);
        if params.fill_cavities {
            cavities::fill(bits, &cavities);
        }
        let is_done = healed.n_patches == 0 || n_left == 0;
        all.add(healed);
        if is_done {
            break;
        }
    }
    report.count("tunnels_left", n_left as f64);
    report.count_usize("tunnel_repairs", all.n_patches);
    report.count_usize("tunnel_repairs_filled_voxels", all.n_filled);
    report.count_usize("tunnel_repairs_cleared_voxels", all.n_cleared);
    all.entries
}
