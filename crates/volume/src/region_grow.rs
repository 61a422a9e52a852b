//! Region growing from a seed.
//!
//! **Input** a volume, a seed voxel, a band of values; with a preset, both can be left open. **Output** one bit a
//! voxel, and how the region grew.
//! **Steps** 0. find the seed and the band's end where they are open: of airways clear of the leak, of
//! vessels half-way from the values inside to those outside; 1. choose the voxels that lie in the band, ends
//! included; 2. label their components by faces (6-connected); 3. keep the seed's.
//! **Guarantees** the result is the 6-connected component of the band that holds the seed; only airways whose threshold was
//! found win more over edges and corners, at darker values. No recursion.
//! **Why not 26-connected?** An airway's wall is thinner than a voxel in places; over edges and corners the
//! region leaks into the lung at the very same threshold.
//! **Cost** O(voxels) time, two bits a voxel and the runs of the band.

use espalier_model::{Bits, Grid, Report, Volume};
use glam::DVec3;

use crate::choose::choose;
use crate::growth::{Growth, Towards};
use crate::kind::Census;
use crate::runs::{Connectivity, Runs};
use crate::select::Selection;
use crate::trachea::SeedCandidate;
use crate::{Error, Params, Preset, growth, half_maximum, margin, trachea};

/// The seed of the parameters as a voxel inside the grid.
pub(crate) fn seed_voxel(grid: &Grid, params: &Params) -> Result<[usize; 3], Error> {
    let shape = grid.shape();
    let inside = |[x, y, z]: [i64; 3]| grid.voxel_at(DVec3::new(x as f64, y as f64, z as f64));
    let (found, shown) = match (params.seed_voxel, params.seed_mm) {
        (Some([x, y, z]), _) => (inside([x, y, z]), format!("voxel ({x}, {y}, {z})")),
        (None, Some([x, y, z])) => {
            let point = grid.voxel_from_world().transform_point3(DVec3::new(x, y, z));
            (grid.voxel_at(point), format!("({x}, {y}, {z}) mm"))
        }
        // `Params::validate` refuses region growing without a seed.
        (None, None) => (None, "(none)".to_owned()),
    };
    found.ok_or(Error::SeedOutside { seed: shown, shape })
}

/// Grows a region from the seed that is given, or found, to the threshold that is given, or found.
pub(crate) fn grow(volume: &Volume, params: &Params) -> Result<Selection, Error> {
    let mut report = Report::default();
    let (seed, seeds) = choose_seed(volume, params, &mut report)?;
    let Chosen { growth, band, kept } = choose_band(volume, params, seed, &mut report)?;
    let bits = match kept {
        Some(bits) => bits,
        None => region(volume, seed, band)?,
    };
    let what = format!("the region in {} to {}", band.0, band.1);
    let mut selection = Selection { growth, seeds, ..Selection::of_scan(bits, band, what) };
    selection.report.extend(report);
    Ok(selection)
}

/// The seed of the parameters, else the trachea.
fn choose_seed(
    volume: &Volume,
    params: &Params,
    report: &mut Report,
) -> Result<([usize; 3], Vec<SeedCandidate>), Error> {
    if params.has_seed() || params.preset != Some(Preset::Airway) {
        return Ok((seed_voxel(volume.grid(), params)?, Vec::new()));
    }
    let candidates = trachea::find(volume);
    let Some(best) = candidates.first() else {
        let mut census = Census::default();
        volume.for_each_value(|value| census.see(value));
        return Err(Error::NoTrachea { min: census.min, max: census.max });
    };
    report.count_usize("seed_candidates", candidates.len());
    report.count_usize("seed_voxel_x", best.voxel[0]);
    report.count_usize("seed_voxel_y", best.voxel[1]);
    report.count_usize("seed_voxel_z", best.voxel[2]);
    report.count("seed_score", best.score);
    report.count("seed_score_of_next", candidates.get(1).map_or(0.0, |next| next.score));
    Ok((best.voxel, candidates))
}

/// How far to grow.
struct Chosen {
    growth: Option<Growth>,
    band: (f64, f64),
    /// The region, where it is more than the seed's component of the band.
    kept: Option<Bits>,
}

impl Chosen {
    fn given(band: (f64, f64)) -> Self {
        Self { growth: None, band, kept: None }
    }
}

/// The band of the parameters; of an end that is not given, what the growth tells.
fn choose_band(
    volume: &Volume,
    params: &Params,
    seed: [usize; 3],
    report: &mut Report,
) -> Result<Chosen, Error> {
    let band = params.band();
    let towards = match (params.lower, params.upper, params.preset) {
        (None, None, Some(preset)) => preset.towards(),
        (None, Some(_), _) => Towards::Bright,
        (Some(_), None, _) => Towards::Dark,
        _ => return Ok(Chosen::given(band)),
    };
    let is_given = params.lower.is_some() || params.upper.is_some();
    let limit = match (towards, params.preset) {
        (_, Some(preset)) if !is_given => preset.limit_hu(),
        (Towards::Bright, _) => band.1,
        (Towards::Dark, _) => band.0,
    };
    let value = volume.value(volume.grid().index(seed));
    let (open_lower, open_upper) = match towards {
        Towards::Bright => (band.0, limit),
        Towards::Dark => (limit, band.1),
    };
    if !(open_lower..=open_upper).contains(&value) {
        return Err(seed_error(volume, seed, (open_lower, open_upper)));
    }
    let mut growth = growth::measure(volume, seed, towards, limit);
    let mut kept = None;
    match towards {
        _ if is_given => {}
        Towards::Dark => growth.half_maximum = half_maximum::find(volume, seed, &growth),
        Towards::Bright => {
            let found = margin::find(volume, seed, &growth, limit);
            (growth.margin, kept) = (found.as_ref().map(|found| found.0), found.map(|found| found.1));
        }
    }
    count(&growth, report);
    if is_given {
        warn_of_leak(&growth, limit, report);
        return Ok(Chosen { growth: Some(growth), ..Chosen::given(band) });
    }
    let threshold = match growth.half_maximum {
        // The seed is darker than most of the lumen: a speck of noise, or outside of it.
        Some(half) if half.level.is_none() => half.threshold,
        _ => growth.threshold().ok_or_else(|| no_knee(&growth))?,
    };
    if growth.half_maximum.is_none() && (growth.margin.is_none() || growth.is_small()) {
        warn_of_no_leak(&growth, limit, report);
    }
    let band = match towards {
        Towards::Bright => (band.0, threshold),
        Towards::Dark => (threshold, band.1),
    };
    Ok(Chosen { growth: Some(growth), band, kept })
}

fn count(growth: &Growth, report: &mut Report) {
    if let Some((stable, leaking)) = growth.leak() {
        report.count("stable_threshold", stable.threshold);
        report.count("stable_ml", growth.ml(stable));
        report.count("leaking_threshold", leaking.threshold);
        report.count("leaking_ml", growth.ml(leaking));
    }
    if let Some(margin) = growth.margin {
        let threshold = |level: usize| growth.levels.get(level).map(|level| level.threshold);
        if let Some(edges) = margin.edges.and_then(threshold) {
            report.count("edges_threshold", edges);
            report.count_usize("edges_voxels", margin.n_won);
        }
    }
    if let Some(half) = growth.half_maximum {
        report.count("value_inside", half.inside);
        report.count("value_outside", half.outside);
        report.count("half_maximum", half.threshold);
    }
}

fn warn_of_leak(growth: &Growth, limit: f64, report: &mut Report) {
    if let Some((stable, leaking)) = growth.leak() {
        report.warn(
            "W-VOLUME-LEAK",
            format!(
                "the region seems to leak: {:.1} ml at {}, {:.1} ml at {}, and the band goes on to {limit}",
                growth.ml(stable),
                stable.threshold,
                growth.ml(leaking),
                leaking.threshold
            ),
        );
    }
}

/// Where nothing leaks the band goes on as far as the preset allows, which is no finding: the user must hear of it.
fn warn_of_no_leak(growth: &Growth, limit: f64, report: &mut Report) {
    let (None, Some(&last)) = (growth.leak(), growth.levels.last()) else { return };
    report.count("reached_threshold", last.threshold);
    report.count("reached_ml", growth.ml(last));
    let (n_voxels, ml, threshold) = (last.n_voxels, growth.ml(last), last.threshold);
    let message = if growth.is_small() {
        format!(
            "the region has {n_voxels} voxels ({ml:.2} ml) at {threshold}, too few to tell a leak: is the seed inside the \
             organ?"
        )
    } else {
        format!(
            "no leak found up to {threshold} (the preset goes to {limit}): the region holds all {ml:.1} ml that the seed \
             reaches; look whether they are the organ's, or set the band"
        )
    };
    report.warn("W-VOLUME-NO-LEAK", message);
}

fn no_knee(growth: &Growth) -> Error {
    let at = |share: f64| {
        let level = growth.levels[((growth.levels.len() - 1) as f64 * share) as usize];
        (level.threshold, growth.ml(level))
    };
    Error::NoKnee { curve: [at(0.0), at(0.25), at(0.5), at(0.75), at(1.0)] }
}

/// The region about `seed` with values in the band.
fn region(volume: &Volume, seed: [usize; 3], (lower, upper): (f64, f64)) -> Result<Bits, Error> {
    let in_band = |value: f64| (lower..=upper).contains(&value);
    if !in_band(volume.value(volume.grid().index(seed))) {
        return Err(seed_error(volume, seed, (lower, upper)));
    }
    let band = choose(volume, in_band);
    let runs = Runs::cut(&band);
    let components = runs.components(Connectivity::Faces);
    let wanted = runs.find(seed).map(|run| components.of_run[run]);
    let mut region = Bits::new(band.shape());
    for row in 0..runs.n_rows() {
        for run in runs.of_row(row).filter(|&run| Some(components.of_run[run]) == wanted) {
            region.fill_run(row, runs.all()[run].range());
        }
    }
    Ok(region)
}

/// The seed is not in the band: tells the nearest voxel that is, or that there is none.
fn seed_error(volume: &Volume, seed: [usize; 3], (lower, upper): (f64, f64)) -> Error {
    let grid = volume.grid();
    let spacing = grid.spacing_mm();
    let point = |[x, y, z]: [usize; 3]| DVec3::new(x as f64, y as f64, z as f64) * spacing;
    let mut nearest: Option<(f64, usize)> = None;
    let (mut min, mut max) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut index = 0;
    volume.for_each_value(|value| {
        if value.is_finite() {
            (min, max) = (min.min(value), max.max(value));
        }
        if (lower..=upper).contains(&value) {
            let distance = point(grid.voxel(index)).distance(point(seed));
            if nearest.is_none_or(|(best, _)| distance < best) {
                nearest = Some((distance, index));
            }
        }
        index += 1;
    });
    match nearest {
        None => Error::Empty { what: format!("the band {lower} to {upper}"), min, max },
        Some((distance_mm, index)) => Error::SeedOutOfBand {
            seed,
            value: volume.value(grid.index(seed)),
            lower,
            upper,
            nearest: grid.voxel(index),
            distance_mm,
        },
    }
}
