//! What a volume is: mask, labels or scan; of a mask its components, loops and size.
//!
//! **Input** a volume file or a DICOM folder. **Output** facts, advice, and the sizes that the stages of a run would meet: of
//! a mask those after its first two stages, of a scan those of an organ of the usual volume.

use std::path::Path;

use espalier_volume::{DicomError, Kind, MaskSurvey, Method, Preset, ReadError, Survey};

use super::Findings;
use crate::artifacts::Lookup;
use crate::config::Source;
use crate::error::Error;
use crate::estimate::{self, Sizes};
use crate::folder::RunFolder;
use crate::run::{self, Request, boxed};
use crate::stage::Stage;
use crate::steps;

/// Airways down to the leak on the scans at hand have 60 to 110 ml, vessels of the lung with contrast about 200.
const AIRWAY_ML: f64 = 90.0;
const VESSEL_ML: f64 = 200.0;
/// A scan in HU has air below and bone or contrast above these.
const HU_AIR: f64 = -500.0;
const HU_BONE: f64 = 200.0;
/// More of a volume than an organ of branches fills.
const LARGEST_SHARE: f64 = 0.5;
/// Voxels so much longer than wide that branches across get stairs.
const LARGEST_ANISOTROPY: f64 = 3.0;
/// How many values of a label map are listed.
const MOST_LISTED: usize = 24;
/// The box around an organ, as a share of its scan.
const ORGAN_BOX: f64 = 0.4;
/// A scan is held whole while a region grows in it, with a bit and a level a voxel.
const HELD_BYTES: u64 = 2;

pub(super) fn examine(run: &Request, path: &Path) -> Result<Findings, Error> {
    steps::check_readable(path, true)?;
    let source = Source::Volume(path.to_owned());
    let artifacts = run::artifacts_of(run, &source);
    let survey = match espalier_volume::survey(path, &artifacts.read_options) {
        Ok(survey) => survey,
        Err(error) => return several_series(error),
    };
    let mut found = Findings::default();
    describe(&survey, &mut found);
    for warning in &survey.report.warnings {
        found.advise(warning.code, warning.message.clone(), "");
    }
    advise(&survey, &mut found);
    settle(run, &survey, &mut found)?;
    Ok(found)
}

/// A folder of several series is what it is; everything else that cannot be read is an error.
fn several_series(error: espalier_volume::Error) -> Result<Findings, Error> {
    let failed = |error| Err(Error::stage(Stage::Volume)(boxed(error)));
    let espalier_volume::Error::Read { problem: ReadError::Dicom(cause), .. } = &error else {
        return failed(error);
    };
    let DicomError::Ambiguous { series } = &**cause else { return failed(error) };
    let mut found = Findings::default();
    found.fact("format", "DICOM", format!("a folder of {} DICOM series", series.len()));
    let listed: Vec<String> = series.iter().map(ToString::to_string).collect();
    found.fact("series", listed.clone(), listed.join(&format!("\n  {:22}", "")));
    found.advise(
        "E-DICOM-SERIES",
        "which series is meant is not said",
        "say --series N, then this can say more",
    );
    Ok(found)
}

fn describe(survey: &Survey, found: &mut Findings) {
    let grid = &survey.grid;
    let ([nx, ny, nz], spacing) = (grid.shape(), grid.spacing_mm());
    let files = if survey.n_files > 1 { format!(", {} files", survey.n_files) } else { String::new() };
    found.fact("format", survey.format, format!("{}{files}", survey.format));
    found.fact("shape", vec![nx, ny, nz], format!("{nx} x {ny} x {nz}"));
    let text = format!("{:.4} x {:.4} x {:.4} mm", spacing.x, spacing.y, spacing.z);
    found.fact("spacing_mm", spacing.to_array().to_vec(), text);
    let orientation = grid.orientation();
    found.fact("orientation", orientation.as_str(), format!("{orientation}, by {}", survey.placed_by));
    let (slope, intercept) = survey.scaling;
    let scaling = if survey.scaling == (1.0, 0.0) {
        String::new()
    } else {
        format!(", times {slope} plus {intercept}")
    };
    found.fact("scalar", survey.scalar, format!("{}{scaling}", survey.scalar));
    let (min, max) = survey.range;
    if min <= max {
        found.fact("range", vec![min, max], format!("{min} to {max}"));
    }
    let (kind, why) = kind_and_why(&survey.kind);
    found.fact("kind", kind, why);
    if let Some(mask) = &survey.mask {
        describe_mask(mask, survey, found);
    }
}

fn kind_and_why(kind: &Kind) -> (&'static str, String) {
    match kind {
        Kind::Mask { background, foreground } => (
            "mask",
            format!("a mask: two values, {background} for the background and {foreground} for the organ"),
        ),
        Kind::Labels { values } => {
            let listed: Vec<String> = values.iter().take(MOST_LISTED).map(ToString::to_string).collect();
            let more = if values.len() > MOST_LISTED { ", …" } else { "" };
            ("labels", format!("a label map: {} whole numbers, {}{more}", values.len(), listed.join(", ")))
        }
        Kind::Ct { .. } => ("scan", "a scan: more values than a mask or a label map has".to_owned()),
        Kind::Constant { value } => {
            ("constant", format!("one value everywhere, {value}: nothing to work on"))
        }
    }
}

fn describe_mask(mask: &MaskSurvey, survey: &Survey, found: &mut Findings) {
    let ml = mask.n_foreground as f64 * survey.grid.voxel_volume_mm3() / 1e3;
    let n = mask.n_foreground;
    found.fact("foreground_voxels", n, n.to_string());
    found.fact("foreground_ml", ml, format!("{ml:.3}"));
    let share = 100.0 * mask.n_largest as f64 / n.max(1) as f64;
    found.fact(
        "components",
        mask.n_components,
        format!("{}, the largest has {share:.1} %", mask.n_components),
    );
    let loops = (mask.n_components as i64 - mask.euler_number).max(0);
    found.fact("euler_number", mask.euler_number, mask.euler_number.to_string());
    found.fact("loops", loops, format!("{loops} tunnels at least: components less the Euler number"));
}

fn advise(survey: &Survey, found: &mut Findings) {
    if survey.has_not_finite {
        found.advise("W-DOCTOR-NAN", "some values are not finite", "they count as background");
    }
    let spacing = survey.grid.spacing_mm();
    if spacing.max_element() > LARGEST_ANISOTROPY * spacing.min_element() {
        let message =
            format!("voxels are {:.1} times as long as wide", spacing.max_element() / spacing.min_element());
        let way_out =
            "a finer reconstruction is best; --set volume.resample_mm=isotropic makes the steps smaller";
        found.advise("W-DOCTOR-SPACING", message, way_out);
    }
    let Some(mask) = &survey.mask else { return };
    let share = mask.n_foreground as f64 / survey.grid.n_voxels() as f64;
    if share > LARGEST_SHARE {
        let message = format!("{:.0} % of the voxels are foreground", 100.0 * share);
        found.advise("W-DOCTOR-FULL", message, "is it inverted, or the organ with all around it?");
    }
    if mask.n_components > 1 {
        let message = format!("there are {} components", mask.n_components);
        let way_out = "those below a twentieth of the largest are dropped; volume.components says otherwise";
        found.advise("W-DOCTOR-COMPONENTS", message, way_out);
    }
    let loops = mask.n_components as i64 - mask.euler_number;
    if loops > 0 {
        let message = format!("there are at least {loops} tunnels, which a tree has not");
        let way_out =
            "small ones are closed (volume.close_tunnels), the others cut where they are thinnest and listed";
        found.advise("W-DOCTOR-LOOPS", message, way_out);
    }
    if mask.touches_border {
        let way_out = "branches end where the scan ends; a scan that reaches further shows their tips";
        found.advise("W-DOCTOR-BORDER", "the mask touches the border of the volume", way_out);
    }
}

/// The commands that suit, and the sizes that they would meet.
fn settle(run: &Request, survey: &Survey, found: &mut Findings) -> Result<(), Error> {
    let params = &run.loaded.config.volume;
    let is_told = params.method != Method::Auto || params.label.is_some();
    match &survey.kind {
        Kind::Constant { .. } => {}
        Kind::Mask { .. } => {
            found.commands.push(Vec::new());
            found.sizes = Some(sizes_of_mask(run)?);
        }
        Kind::Labels { .. } if !is_told => {
            found.commands.push(vec!["--label", "VALUE"]);
            let way_out = "--label with a value or a name says which is the organ";
            found.advise("W-DOCTOR-LABEL", "which label is the organ is not said", way_out);
        }
        _ if is_told && params.method != Method::RegionGrow => {
            found.commands.push(Vec::new());
            found.sizes = Some(sizes_of_mask(run)?);
        }
        _ => settle_scan(run, survey, found),
    }
    Ok(())
}

fn settle_scan(run: &Request, survey: &Survey, found: &mut Findings) {
    let preset = run.loaded.config.volume.preset;
    let is_grown = run.loaded.config.volume.method == Method::RegionGrow;
    let (min, max) = survey.range;
    let is_hu = min < HU_AIR && max > HU_BONE;
    if preset.is_none() && !is_grown {
        found.commands = if is_hu {
            vec![vec!["--preset", "airway"], vec!["--preset", "vessel"]]
        } else {
            vec![vec!["--set", "volume.method=threshold", "--set", "volume.lower=VALUE"]]
        };
        if !is_hu {
            let way_out =
                "a threshold or a region that grows chooses the organ; a segmentation of it is better";
            found.advise(
                "W-DOCTOR-NOT-HU",
                "the values are no Hounsfield units: presets do not apply",
                way_out,
            );
        }
    } else {
        found.commands.push(Vec::new());
    }
    let (what, ml) = match preset {
        Some(Preset::Vessel) => ("vessels", VESSEL_ML),
        _ => ("airways", AIRWAY_ML),
    };
    if !is_hu {
        return;
    }
    let foreground = (ml * 1e3 / survey.grid.voxel_volume_mm3()) as u64;
    found.assumed = Some(format!("{ml:.0} ml of {what}"));
    let voxels = survey.grid.n_voxels() as u64;
    let keeps_to_mask = run.loaded.config.radius.wall == espalier_radius::Wall::Mask;
    let sampled = if keeps_to_mask { 0 } else { (ORGAN_BOX * voxels as f64) as u64 };
    found.sizes = Some(Sizes { voxels, held_bytes: HELD_BYTES, foreground, sampled, ..Sizes::default() });
}

/// The sizes after the first two stages of a run.
fn sizes_of_mask(run: &Request) -> Result<Sizes, Error> {
    let source = run::source_of(&run.loaded, run.data_dir.as_deref())?;
    let artifacts = run::artifacts_of(run, &source);
    let nowhere = RunFolder::to_read(Path::new(""));
    let lookup = Lookup { folder: &nowhere, stage: Stage::Volume };
    let mask = artifacts.segmented(lookup, &run.loaded.config.volume)?.mask;
    let sizes = Sizes::of_mask(&mask);
    if estimate::cost(Stage::Skeleton, &sizes).bytes > run.max_memory_bytes {
        return Ok(sizes);
    }
    let thinned = espalier_skeleton::skeletonize(&mask, &run.loaded.config.skeleton)
        .map_err(|error| Error::stage(Stage::Skeleton)(boxed(error)))?;
    Ok(Sizes { skeleton: thinned.skeleton.voxels().len() as u64, ..sizes })
}
