//! [`Volume`] → [`Mask`].
//!
//! **Input** a volume and [`Params`]. **Output** [`Segmented`].
//! **Steps** 0. a scan that is wanted at another spacing is resampled; 1. choose the organ's voxels by value, or by
//! growing from a seed; 2. turn the axes to right, anterior, superior; 3. a mask that is wanted at another spacing is
//! resampled; 4. close gaps; 5. drop the components that are not wanted; 6. fill cavities; 7. close tunnels that are faults
//! of the mask.
//! **Guarantees** the mask has at least one voxel, and lies where the volume does; it depends on what is in the volume,
//! not on the order in which a file stores it; every step's effect is in the report.

use espalier_model::{Bits, Grid, Ledger, Mask, Report, Volume};
use glam::DVec3;

use crate::cavities::Cavities;
use crate::euler::euler_number;
use crate::growth::Growth;
use crate::heal::Healed;
use crate::kind::Census;
use crate::runs::{Connectivity, Runs};
use crate::select::{Selection, needs_preset, select};
use crate::trachea::SeedCandidate;
use crate::{
    Error, Method, Orientation, Params, ReadOptions, cavities, closing, components, heal, inspect_kind,
    region_grow, resample, thick,
};

/// How often places to close tunnels are looked for; on the masks at hand the second pass finds a few, the third
/// none.
const MAX_PASSES: usize = 4;

/// A mask, and what was done to get it.
#[derive(Clone, Debug, PartialEq)]
pub struct Segmented {
    /// The organ.
    pub mask: Mask,
    /// Where x, y and z pointed before the turn, such as `LPS`.
    pub stored_orientation: String,
    /// An entry for each gap that was closed, largest first, beyond 200 one for all others; for each component that was
    /// dropped, largest first, beyond 200 one for all others; then an entry for
    /// each place at which a tunnel was closed.
    pub ledger: Ledger,
    /// Counts `selected_voxels`, `selected_ml`, where gaps were closed `closing_patches`, `closing_filled_voxels`; `components`, `components_dropped`, `components_dropped_voxels`,
    /// `component_largest_voxels`, `component_dropped_largest_voxels`, `cavities_filled`,
    /// `cavities_filled_voxels`, `tunnels`, `foreground_voxels`, `foreground_ml`. Where tunnels were closed also
    /// `tunnels_left`, `tunnel_repairs`, `tunnel_repairs_filled_voxels`, `tunnel_repairs_cleared_voxels`. Of a region
    /// that grew also `stable_threshold`, `stable_ml`, `leaking_threshold`, `leaking_ml` where it leaks, of airways
    /// `edges_threshold`, `edges_voxels` where voxels were won over edges and corners, and of vessels `half_maximum`, `value_inside`, `value_outside` where these were found; of a seed that was found `seed_candidates`, `seed_voxel_x/y/z`, `seed_score`, `seed_score_of_next`.
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
    segment_within(volume, params, ReadOptions::default().max_bytes)
}

/// [`segment`], where no step takes more than `max_bytes` of memory at a time.
pub(crate) fn segment_within(volume: &Volume, params: &Params, max_bytes: u64) -> Result<Segmented, Error> {
    params.validate()?;
    let wanted = params.resample_mm.filter(|_| is_scan(volume, params));
    let mut report = Report::default();
    let resampled = match wanted {
        Some(spacing) => resample::scan(volume, spacing, max_bytes, &mut report)?,
        None => None,
    };
    let mut params = params.clone();
    if wanted.is_some() {
        // The spacing is the one that was wanted.
        params.resample_mm = None;
        params.thick_slices = 0.0;
    }
    if resampled.is_some() && params.has_seed() {
        // A seed in voxels is meant on the file's own axes.
        let [x, y, z] = region_grow::seed_voxel(volume.grid(), &params)?.map(|coordinate| coordinate as f64);
        let seed_mm = volume.grid().world_from_voxel().transform_point3(DVec3::new(x, y, z));
        (params.seed_voxel, params.seed_mm) = (None, Some(seed_mm.to_array()));
    }
    let volume = resampled.as_ref().unwrap_or(volume);
    let selection = select(volume, &params)?;
    let segmented = segment_selection(selection, volume.grid(), (&params, max_bytes), || {
        let mut census = Census::default();
        volume.for_each_value(|value| census.see(value));
        Ok((census.min, census.max))
    })?;
    report.extend(segmented.report);
    Ok(Segmented { report, ..segmented })
}

/// Whether voxels are chosen by intensities.
fn is_scan(volume: &Volume, params: &Params) -> bool {
    match params.method {
        Method::Threshold | Method::RegionGrow => true,
        Method::Mask | Method::Label => false,
        Method::Auto => {
            let may_be = params.label.is_none() && params.preset.is_some();
            may_be && needs_preset(&inspect_kind(volume), params.method)
        }
    }
}

/// What [`segment`] does once the voxels are chosen. `range` tells the smallest and the largest finite value, for a
/// message.
pub(crate) fn segment_selection(
    selection: Selection,
    grid: &Grid,
    (params, max_bytes): (&Params, u64),
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
    let components = params.components.settled(selection.is_of_scan);
    let params = Params { components, ..params.clone() };
    let cleaned = clean_within(Mask::new(grid.clone(), selection.bits), &params, max_bytes)?;
    report.extend(cleaned.report);
    Ok(Segmented { report, growth: selection.growth, seeds: selection.seeds, ..cleaned })
}

/// Cleans a mask: of the parameters, all that do not choose voxels. Turns its axes first.
///
/// # Errors
/// [`Error`] for parameters out of range, and for a mask of which nothing is left.
pub fn clean(mask: Mask, params: &Params) -> Result<Segmented, Error> {
    clean_within(mask, params, ReadOptions::default().max_bytes)
}

/// [`clean`], where no step takes more than `max_bytes` of memory at a time.
fn clean_within(mask: Mask, params: &Params, max_bytes: u64) -> Result<Segmented, Error> {
    params.validate()?;
    let params = &Params { components: params.components.settled(false), ..params.clone() };
    let mut report = Report::default();
    // What follows settles ties by storage order, here and in the later stages.
    let stored_orientation = mask.grid().orientation();
    let file_axes = mask.grid().nearest_world_axes();
    let mut mask = in_order(mask, params.orientation)?;
    let has_own_grid = params.resample_mm.is_none() && params.orientation == Orientation::Ras;
    if let Some(spacing) = params.resample_mm {
        // It is meant along the file's own axes, which may be others now.
        let spacing = match params.orientation {
            Orientation::Ras => spacing.turned(file_axes.map(|(world_axis, _)| world_axis)),
            Orientation::Stored => spacing,
        };
        // The new grid has an origin of its own.
        mask = in_order(resample::mask(mask, spacing, max_bytes, &mut report)?, params.orientation)?;
    }
    let grid = mask.grid().clone();
    let mut bits = mask.into_bits();
    let n_selected = bits.count();
    report.count_usize("selected_voxels", n_selected);
    report.count("selected_ml", millilitres(n_selected, &grid));

    // Close gaps.
    let mut ledger = Ledger::default();
    if params.closing_mm > 0.0 {
        let filled = closing::close(&mut bits, &grid, params.closing_mm, max_bytes)?;
        report.count_usize("closing_patches", filled.n_patches);
        report.count_usize("closing_filled_voxels", filled.n_voxels);
        ledger.0.extend(filled.entries);
    }

    // Drop components.
    let runs = Runs::cut(&bits);
    let (dropped, n_dropped) = components::keep(&mut bits, &runs, &grid, params, &mut report);
    ledger.0.extend(dropped.0);
    let runs = if n_dropped > 0 { Runs::cut(&bits) } else { runs };

    // Fill cavities, close tunnels that are faults of the mask; and once more between slices.
    let mut mended = Mended::default();
    let n_components = report.get("components").unwrap_or(0.0) as usize - n_dropped;
    let n_tunnels = mended.mend(&mut bits, (&runs, n_components), &grid, params);
    let mut mask = Mask::new(grid, bits);
    if has_own_grid && params.thick_slices > 0.0 && mask.n_foreground() > 0 {
        let from = mask.grid().shape();
        mask = thick::refine(mask, (params.thick_slices, max_bytes), &mut report)?;
        if mask.grid().shape() != from {
            mask = in_order(mask, params.orientation)?;
            let (grid, mut bits) = (mask.grid().clone(), mask.into_bits());
            let runs = Runs::cut(&bits);
            let n_components = runs.components(Connectivity::All).n_components;
            mended.mend(&mut bits, (&runs, n_components), &grid, params);
            mask = Mask::new(grid, bits);
        }
    }
    mended.describe(n_tunnels, params, (&mut ledger, &mut report));
    let n_foreground = mask.n_foreground();
    if n_foreground == 0 {
        let what = "the mask after cleaning".to_owned();
        return Err(Error::Empty { what, min: 0.0, max: 1.0 });
    }
    report.count_usize("foreground_voxels", n_foreground);
    report.count("foreground_ml", millilitres(n_foreground, mask.grid()));
    Ok(Segmented { mask, stored_orientation, ledger, report, growth: None, seeds: Vec::new() })
}

fn millilitres(n_voxels: usize, grid: &Grid) -> f64 {
    n_voxels as f64 * grid.voxel_volume_mm3() / 1000.0
}

/// The mask in the axis order that is wanted.
///
/// # Errors
/// [`Error::Turn`] where its place in the world is beyond the largest number.
pub fn in_order(mask: Mask, orientation: Orientation) -> Result<Mask, Error> {
    match orientation {
        Orientation::Ras => Ok(mask.in_ras_order()?),
        Orientation::Stored => Ok(mask),
    }
}

/// Cavities that were filled, and tunnels that were closed.
#[derive(Default)]
struct Mended {
    n_cavities: usize,
    n_filled: usize,
    healed: Healed,
    /// The tunnels left, where any were to be closed.
    n_left: Option<i64>,
}

impl Mended {
    /// Fills cavities and closes tunnels of a mask; returns how many tunnels it had. Cavities are filled first: closed
    /// ones cannot be mistaken for tunnels.
    fn mend(
        &mut self,
        bits: &mut Bits,
        (runs, n_components): (&Runs, usize),
        grid: &Grid,
        params: &Params,
    ) -> i64 {
        let cavities = cavities::find(runs, grid.shape());
        let n_tunnels = (n_components + cavities.n_cavities) as i64 - euler_number(bits);
        if params.fill_cavities {
            self.fill(bits, &cavities);
        }
        if params.close_tunnels && n_tunnels > 0 {
            self.close_tunnels(bits, grid, params);
        }
        n_tunnels
    }

    fn fill(&mut self, bits: &mut Bits, cavities: &Cavities) {
        cavities::fill(bits, cavities);
        self.n_cavities += cavities.n_cavities;
        self.n_filled += cavities.n_voxels;
    }

    /// Closes tunnels, and fills what that may have closed in, until no place is left to be changed.
    fn close_tunnels(&mut self, bits: &mut Bits, grid: &Grid, params: &Params) {
        for _ in 0..MAX_PASSES {
            let healed = heal::heal(bits, grid);
            let runs = Runs::cut(bits);
            let cavities = cavities::find(&runs, grid.shape());
            let n_components = runs.components(Connectivity::All).n_components;
            let n_left = (n_components + cavities.n_cavities) as i64 - euler_number(bits);
            if params.fill_cavities {
                self.fill(bits, &cavities);
            }
            let is_done = healed.n_patches == 0 || n_left == 0;
            self.healed.add(healed);
            self.n_left = Some(n_left);
            if is_done {
                break;
            }
        }
    }

    fn describe(self, n_tunnels: i64, params: &Params, (ledger, report): (&mut Ledger, &mut Report)) {
        if params.fill_cavities {
            report.count_usize("cavities_filled", self.n_cavities);
            report.count_usize("cavities_filled_voxels", self.n_filled);
        }
        report.count("tunnels", n_tunnels as f64);
        if let Some(n_left) = self.n_left {
            report.count("tunnels_left", n_left as f64);
            report.count_usize("tunnel_repairs", self.healed.n_patches);
            report.count_usize("tunnel_repairs_filled_voxels", self.healed.n_filled);
            report.count_usize("tunnel_repairs_cleared_voxels", self.healed.n_cleared);
            ledger.0.extend(self.healed.entries);
        }
    }
}
