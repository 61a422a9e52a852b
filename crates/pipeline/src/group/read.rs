//! A run as a group shows it.
//!
//! **Input** a run folder. **Output** its numbers and its map in small, or why there are none.
//! **Steps** 1. A run that has noted why it stopped, or has no embedding, is unfinished: the reason is that note, else that it
//! ended after its last stage. 2. Tree and embedding, then what the stages said. 3. The small map.
//! **Guarantees** nothing is written; each file is checked against the run's digests; a reason holds no path.

use std::collections::BTreeMap;
use std::path::Path;

use espalier_model::{Diagnose, Embedding, Ledger, LedgerKind, Tree, swc};
use espalier_report::group::{Failed, GroupOutcome, Mapped, Measured};
use espalier_report::{Rows, StageFacts};

use crate::error::Error;
use crate::failure;
use crate::folder::RunFolder;
use crate::page::{LEDGER, said};
use crate::provenance;
use crate::settings;
use crate::shell;
use crate::stage::{Artifact, Stage};

/// A folder without a run in it.
pub(super) fn no_run(path: &Path) -> Failed {
    let reason = if path.is_dir() {
        "a folder without a run, and without run folders in it"
    } else if path.exists() {
        "a file, not a run folder"
    } else {
        "there is no such folder: it was never run, or stopped before its first stage was done"
    };
    Failed { code: "E-GROUP-NO-RUN".to_owned(), reason: reason.to_owned(), done_to: None, retry: None }
}

/// What a run came to.
pub(super) fn run(path: &Path, label: &str, side_px: u32) -> GroupOutcome {
    let folder = RunFolder::to_read(path);
    // What an earlier run has left beside such a note is not what was asked for last.
    if failure::read(path).is_some() || !path.join(Artifact::Embedding.file()).exists() {
        return GroupOutcome::Failed(unfinished(&folder, label));
    }
    match mapped(&folder, side_px) {
        Ok(mapped) => GroupOutcome::Mapped(Box::new(mapped)),
        Err(Unread { from, error }) => GroupOutcome::Failed(Failed {
            code: error.code().to_owned(),
            reason: reason(&error),
            done_to: done_to(&folder).map(|stage| stage.name().to_owned()),
            retry: Some(retry(from, label)),
        }),
    }
}

/// A run that has no map yet.
pub(super) fn unfinished(folder: &RunFolder, label: &str) -> Failed {
    let done = done_to(folder);
    // A traced phantom has no scan, so that its tree comes next.
    let is_traced = done == Some(Stage::Phantom) && !folder.path().join(Artifact::Volume.file()).exists();
    let comes_next = |stage: &Stage| Some(*stage) > done && (*stage >= Stage::Tree || !is_traced);
    let next = Stage::ALL.into_iter().find(comes_next);
    let noted = failure::read(folder.path());
    let stopped = noted.as_ref().and_then(|failure| Stage::from_name(failure.stage.as_deref()?));
    let is_next = |next: &Stage| stopped.is_none_or(|stage| stage >= *next);
    let (code, reason) = match noted {
        Some(failure) => {
            let stage = failure.stage.map(|stage| format!("{stage}: ")).unwrap_or_default();
            (failure.code, format!("{stage}{}", failure.reason))
        }
        None => {
            let reason = match done {
                Some(stage) => format!("ended after {stage}: asked for no more, killed, or still at work"),
                None => "no stage is done: killed, or still at work".to_owned(),
            };
            ("E-GROUP-UNFINISHED".to_owned(), reason)
        }
    };
    // What lies behind the stage that failed was made with other settings, or from another input.
    let retry = match (done, next.filter(is_next)) {
        (Some(_), Some(next)) => retry(next, label),
        _ => format!("espalier run CONFIG -o {}", shell::word(label)),
    };
    Failed { code, reason, done_to: done.map(|stage| stage.name().to_owned()), retry: Some(retry) }
}

/// The last stage whose report is there.
fn done_to(folder: &RunFolder) -> Option<Stage> {
    let has_report = |stage: &Stage| folder.path().join(stage.folder()).join("report.json").exists();
    Stage::ALL.into_iter().rfind(has_report)
}

/// The commands that do a stage and all later ones, each with the folder's own settings.
fn retry(from: Stage, label: &str) -> String {
    let label = shell::word(label);
    let stages = Stage::ALL.into_iter().filter(|stage| *stage >= from && *stage > Stage::Phantom);
    stages.map(|stage| format!("espalier {stage} {label}")).collect::<Vec<_>>().join(" && ")
}

/// What an error says, without the path of its file.
fn reason(error: &Error) -> String {
    let name =
        |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    match error {
        Error::File { path, cause } => format!("{}: {cause}", name(path)),
        Error::Altered { path } => format!("{} is not what the run's SHA256SUMS says", name(path)),
        Error::Read { path, source } => format!("cannot read {}: {source}", name(path)),
        other => other.code().to_owned(),
    }
}

/// A run whose map cannot be read.
struct Unread {
    /// The stage that would make it again.
    from: Stage,
    error: Error,
}

fn mapped(folder: &RunFolder, side_px: u32) -> Result<Mapped, Unread> {
    let at = |from| move |error| Unread { from, error };
    let text = |artifact: Artifact| -> Result<String, Error> {
        Ok(String::from_utf8_lossy(&folder.read(artifact.file())?).into_owned())
    };
    let path = |artifact: Artifact| folder.path().join(artifact.file());
    let tree = text(Artifact::Tree)
        .and_then(|text| swc::read_tree(&text).map_err(|error| Error::file(&path(Artifact::Tree), error)))
        .map_err(at(Stage::Tree))?;
    let embedding = text(Artifact::Embedding)
        .and_then(|text| {
            Embedding::from_json(&text, &tree).map_err(|error| Error::file(&path(Artifact::Embedding), error))
        })
        .map_err(at(Stage::Embed))?;
    let thumbnail = espalier_render::thumbnail(&tree, &embedding, side_px)
        .map_err(|error| at(Stage::Embed)(Error::file(&path(Artifact::Embedding), error)))?;
    let measured = measured(folder, &tree, &embedding).map_err(at(Stage::Tree))?;
    let about = || -> Result<_, Error> {
        let inputs = folder.text_if_there(provenance::INPUTS_FILE)?;
        let settings = folder.text_if_there(settings::FILE)?;
        Ok((inputs.unwrap_or_default(), settings.unwrap_or_default()))
    };
    let (inputs, settings) = about().map_err(at(Stage::Volume))?;
    Ok(Mapped {
        measured,
        thumbnail_png: thumbnail.png,
        side_mm: thumbnail.side_mm,
        inputs: provenance::input_digests(&inputs),
        tree: embedding.tree,
        settings: compared_settings(&settings),
    })
}

fn measured(folder: &RunFolder, tree: &Tree, embedding: &Embedding) -> Result<Measured, Error> {
    let stages = said(folder, &Stage::ALL)?;
    let spacing = ["spacing_x_mm", "spacing_y_mm", "spacing_z_mm"];
    let ledger = folder
        .text_if_there(LEDGER)?
        .map(|text| Ledger::from_tsv(&text))
        .transpose()
        .map_err(|error| Error::file(&folder.path().join(LEDGER), error))?
        .unwrap_or_default();
    let stenoses = folder.text_if_there("stenoses.tsv")?.map(|text| Rows::parse(&text)).unwrap_or_default();
    let branches = tree.branches();
    let generations = branches.list().iter().map(|branch| branch.generation);
    Ok(Measured {
        branches: branches.list().len(),
        tips: tree.n_tips(),
        total_length_mm: tree.length_mm(),
        radius_mean_mm: tree.mean_radius_mm(),
        generation_max: generations.max().unwrap_or(0),
        length_loss_mean: embedding.losses.length_loss_mean,
        angle_loss_mean: embedding.losses.angle_loss_mean,
        angle3d_error_mean_deg: embedding.losses.angle3d_error_mean_deg,
        energy: embedding.energy.total(),
        // Not what the file states: a page must not repeat what does not hold.
        crossings: espalier_embed::certify(tree, &embedding.positions_mm).crossings,
        overlaps: embedding.widths.overlaps,
        warnings: stages.iter().map(|stage| stage.warnings.len()).sum(),
        loops_cut: ledger.n_of(LedgerKind::LoopCut),
        spurs_pruned: ledger.n_of(LedgerKind::SpurPruned),
        narrow_places: stenoses.len(),
        voxel_mm: spacing.map(|name| count(&stages, Stage::Volume, name)),
    })
}

fn count(stages: &[StageFacts], stage: Stage, name: &str) -> f64 {
    let facts = stages.iter().find(|facts| facts.stage == stage.name());
    let value = facts.and_then(|facts| facts.counts.iter().find(|(known, _)| known == name));
    value.map_or(f64::NAN, |(_, value)| *value)
}

/// The settings by which runs are told apart: not their names, pictures and pages.
fn compared_settings(text: &str) -> BTreeMap<String, String> {
    let mut settings = settings::flat(text);
    settings.retain(|key, _| {
        let table = key.split('.').next().unwrap_or_default();
        Stage::from_name(table).is_some_and(|stage| stage < Stage::Render)
            || matches!(table, "input" | "seed")
    });
    settings
}
