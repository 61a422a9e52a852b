//! Scan, label map or mask → mask.

use std::sync::Arc;

use espalier_model::{GridError, Ledger, Mask, nifti_out};
use espalier_volume::Growth;

use super::{Outcome, Step, describe_grid};
use crate::error::Error;
use crate::page;
use crate::stage::Artifact;

pub(super) fn volume(step: &mut Step<'_>) -> Result<Outcome, Error> {
    let params = step.config.volume.clone();
    let segmented = step.take(|artifacts, lookup| artifacts.segmented(lookup, &params))?;
    let mask = on_stored_grid(segmented.mask).map_err(|error| step.failed(error))?;
    let n_foreground = mask.n_foreground();
    let mut line = format!(
        "{n_foreground} voxels, {:.1} ml of {}",
        n_foreground as f64 * mask.grid().voxel_volume_mm3() / 1000.0,
        describe_grid(mask.grid())
    );
    if mask.grid().orientation() != segmented.stored_orientation {
        line = format!("{line}, stored as {}", segmented.stored_orientation);
    }
    let dropped = segmented.ledger.to_tsv();
    step.artifacts.dropped = Some(step.read_back(&dropped, Ledger::from_tsv)?);
    let n_dropped = segmented.report.get("components_dropped").unwrap_or(0.0);
    if n_dropped > 0.0 {
        line = format!("{line}; {n_dropped} components dropped");
    }
    line.extend(segmented.growth.as_ref().map(said_of_growth));
    let mut report = segmented.report;
    let slices = page::slices(step, &mask, &mut report)?;
    if let Some(left) = report.get("tunnels_left") {
        line = format!("{line}; {} tunnels, {left} left", report.get("tunnels").unwrap_or(left));
    }
    let mut files = vec![
        step.place(Artifact::Mask, nifti_out::mask(&mask).map_err(|error| step.failed(error))?),
        step.beside("dropped.tsv", dropped.into_bytes()),
    ];
    if let Some(growth) = &segmented.growth {
        files.push(step.beside("growth.tsv", growth.to_tsv().into_bytes()));
    }
    if !segmented.seeds.is_empty() {
        files.push(step.beside("seeds.tsv", espalier_volume::seeds_to_tsv(&segmented.seeds).into_bytes()));
    }
    files.extend(slices);
    step.artifacts.mask = Some(Arc::new(mask));
    Ok(Outcome { files, report, line })
}

/// Where a region that grew has ended, and why there.
fn said_of_growth(growth: &Growth) -> String {
    let half = growth.half_maximum.zip(growth.half_level()).map(|(half, level)| {
        let (inside, outside) = (half.inside, half.outside);
        format!(
            "; grown to {}, half-way from {inside} inside to {outside} outside is {}",
            level.threshold, half.threshold
        )
    });
    let margin = growth.margin.map(|margin| {
        let threshold = |level: usize| growth.levels.get(level).map_or(f64::NAN, |level| level.threshold);
        let edges = margin.edges.map(|level| {
            format!(", and {} voxels over edges and corners up to {}", margin.n_won, threshold(level))
        });
        format!("; grown to {}{}", threshold(margin.faces), edges.unwrap_or_default())
    });
    let leak = growth.leak().map(|(stable, leaking)| {
        format!("; it leaks at {}, {} is the last before", leaking.threshold, stable.threshold)
    });
    half.or(margin).unwrap_or_default() + &leak.unwrap_or_default()
}

/// The mask on its grid as a later stage would read it from the file.
fn on_stored_grid(mask: Mask) -> Result<Mask, GridError> {
    let grid = nifti_out::stored_grid(mask.grid())?;
    Ok(if grid == *mask.grid() { mask } else { Mask::new(grid, mask.into_bits()) })
}
