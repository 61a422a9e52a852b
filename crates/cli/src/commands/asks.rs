//! What changes nothing: a folder verified, an input examined, the way to a place of a run, points of the scan and the map.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use anyhow::anyhow;
use espalier_model::Diagnose;
use espalier_pipeline::{DoctorRequest, Error, PlotRequest, Plotted, Space, WayTo};

use super::{data_dir, half_of_memory};
use crate::args::{
    Arguments, DoctorArguments, LocateArguments, PlaceArguments, ProfileArguments, VerifyArguments,
};
use crate::{checks, failure, progress, summary};

/// The largest table of points that is read.
const MAX_TABLE_BYTES: u64 = 64 << 20;

/// Checks a run folder and prints what came of each claim.
pub(super) fn verify(arguments: &Arguments, verify: &VerifyArguments) -> anyhow::Result<()> {
    let threads = arguments.common.threads.map(usize::from);
    let verification = espalier_pipeline::verify(&verify.folder, threads)?;
    if arguments.common.json {
        progress::result(verification.to_json().trim_end());
    } else {
        let is_shown = |fails: bool| fails || !arguments.common.quiet;
        checks::table(&verification, is_shown).iter().for_each(|line| progress::result(line));
        progress::result(&format!("digest {}", verification.digest));
    }
    Ok(verification.verdict()?)
}

/// Prints the calibre on the way to a place, or draws it.
pub(super) fn profile(arguments: &Arguments, profile: &ProfileArguments) -> anyhow::Result<()> {
    let PlaceArguments { node, branch, to } = profile.place;
    let to_point = to.map(|point| WayTo::Point(point.into()));
    let way_to = node.map(WayTo::Node).or(branch.map(WayTo::Branch)).or(to_point);
    let way_to = way_to.ok_or_else(|| anyhow!("say where to: --node, --branch or --to"))?;
    if let Some(plot) = &profile.plot {
        let request = PlotRequest {
            folder: profile.folder.clone(),
            way_to,
            plot: plot.clone(),
            overrides: arguments.common.overrides.clone(),
        };
        let plotted = espalier_pipeline::plot_profile(&request)?;
        if arguments.common.json {
            progress::result(&narrowest_json(plot, &plotted).to_string());
        } else {
            progress::result(&narrowest_line(&plotted));
            progress::result(&plot.display().to_string());
        }
        return Ok(());
    }
    let table = espalier_pipeline::profile(&profile.folder, way_to)?;
    progress::result(&if arguments.common.json {
        summary::rows(&table)
    } else {
        table.trim_end().to_owned()
    });
    Ok(())
}

fn narrowest_json(plot: &Path, plotted: &Plotted) -> serde_json::Value {
    let place = plotted.narrowest.as_ref().map(|place| {
        serde_json::json!({
            "narrowing_percent": place.narrowing_percent,
            "from_root_mm": place.from_root_mm,
            "branch": place.branch,
            "node": place.node,
            "radius_mm": place.radius_mm,
            "reference_radius_mm": place.reference_radius_mm,
            "is_listed": plotted.is_listed,
        })
    });
    serde_json::json!({ "file": plot.display().to_string(), "narrowest": place })
}

fn narrowest_line(plotted: &Plotted) -> String {
    let Some(place) = &plotted.narrowest else { return "nowhere narrower than its reference".to_owned() };
    format!(
        "narrowest {:.1} % at {:.4} mm from the root, branch {}, node {}: radius {:.4} mm of {:.4}{}",
        place.narrowing_percent,
        place.from_root_mm,
        place.branch,
        place.node,
        place.radius_mm,
        place.reference_radius_mm,
        if plotted.is_listed { "" } else { " (not listed in stenoses.tsv)" }
    )
}

/// Prints where points lie on both sides.
pub(super) fn locate(arguments: &Arguments, locate: &LocateArguments) -> anyhow::Result<()> {
    let in_patient = match (locate.lps, locate.voxel) {
        (true, _) => Space::Lps,
        (_, true) => Space::Voxel,
        _ => Space::Ras,
    };
    let spaces = [in_patient, if locate.pixel { Space::Pixel } else { Space::Plane }];
    let point = |text: &String| {
        espalier_pipeline::read_point(text, spaces).map_err(|cause| Error::Point { source_name: None, cause })
    };
    let mut points = locate.points.iter().map(point).collect::<Result<Vec<_>, _>>()?;
    if let Some(path) = &locate.from {
        let (source_name, table) = read_table(path)?;
        let more = espalier_pipeline::read_points(&table, spaces);
        points.extend(more.map_err(|cause| Error::Point { source_name: Some(source_name), cause })?);
    }
    let max_memory = arguments.common.max_memory.unwrap_or_else(half_of_memory);
    let located = espalier_pipeline::locate(&locate.folder, &points, max_memory)?;
    let text = match (arguments.common.json, points.len()) {
        (true, _) => located.to_json(),
        (false, 1) => located.to_text(),
        _ => located.to_tsv(),
    };
    progress::result(text.trim_end());
    Ok(())
}

/// A table and its name, from a file or from standard input.
fn read_table(path: &Path) -> Result<(String, String), Error> {
    let (name, read): (&Path, Box<dyn Read>) = if path == Path::new("-") {
        (Path::new("standard input"), Box::new(std::io::stdin()))
    } else {
        let open = File::open(path).map_err(|source| Error::Read { path: path.to_owned(), source })?;
        (path, Box::new(open))
    };
    let mut text = String::new();
    let n_read = read.take(MAX_TABLE_BYTES + 1).read_to_string(&mut text);
    let needed = n_read.map_err(|source| Error::Read { path: name.to_owned(), source })? as u64;
    if needed > MAX_TABLE_BYTES {
        return Err(Error::TooLarge { path: name.to_owned(), needed, limit: MAX_TABLE_BYTES });
    }
    Ok((name.display().to_string(), text))
}

/// Prints what inputs are. One that cannot be read does not keep the others from being looked at.
pub(super) fn doctor(arguments: &Arguments, doctor: &DoctorArguments) -> anyhow::Result<()> {
    let (mut first_error, mut entries) = (None, Vec::new());
    let threads = arguments.common.threads.map_or_else(cores, usize::from);
    for input in &doctor.inputs {
        let request = DoctorRequest {
            config_or_input: input.clone(),
            overrides: arguments.common.overrides.clone(),
            threads: arguments.common.threads.map(usize::from),
            max_memory_bytes: arguments.common.max_memory.unwrap_or_else(half_of_memory),
            data_dir: data_dir(),
        };
        let name = input.display().to_string();
        match espalier_pipeline::doctor(&request) {
            Ok(examined) if arguments.common.json => {
                entries.push(serde_json::json!({ "input": name, "found": examined.to_json(threads) }));
            }
            Ok(examined) => progress::result(examined.to_text(threads).trim_end()),
            Err(error) => {
                let (code, message, hint) = (error.code(), error.to_string(), error.hint());
                let told = serde_json::json!({ "code": code, "message": message, "hint": hint });
                entries.push(serde_json::json!({ "input": name, "error": told }));
                // The last word on the first one is that of every command.
                let error = anyhow::Error::from(error);
                if first_error.is_some() && !arguments.common.json {
                    failure::last_word(&error);
                }
                first_error.get_or_insert(error);
            }
        }
    }
    if arguments.common.json {
        let whole = serde_json::json!({ "format": "espalier-doctor", "version": 1, "inputs": entries });
        progress::result(&serde_json::to_string_pretty(&whole).unwrap_or_default());
    }
    first_error.map_or(Ok(()), Err)
}

/// How many threads a run has if nobody says.
fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}
