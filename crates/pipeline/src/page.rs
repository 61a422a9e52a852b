//! The page of a run: what it is made from, gathered from the files of the stages before.
//!
//! **Input** the run folder. **Output** the facts that `espalier_report` takes, as values.
//! **Guarantees** files as they were written, each checked against its digest; what is not there is left out, and the page
//! says so. Of files that the user names in place of the folder's own only these are used: what else lies in the folder
//! may be of another tree.

use espalier_model::{Embedding, Ledger, Mask, Report, Tree};
use espalier_render::{ColorBy, ColorTable, Theme, color_table};
use espalier_report::{Coloring, Facts, InputFile, InputKind, Mosaic, Rows, Setting, Slices, StageFacts};
use serde::Deserialize;

use crate::artifacts::Artifacts;
use crate::config::Source;
use crate::error::Error;
use crate::estimate::Sizes;
use crate::folder::RunFolder;
use crate::labels;
use crate::provenance;
use crate::run::stages_of;
use crate::settings;
use crate::stage::{Artifact, Stage};
use crate::steps::{Outcome, Step};

/// The counts of the volume stage that go with the slices: the range of the scan, and what is black and white.
const INTENSITIES: [&str; 4] = ["intensity_min", "intensity_max", "intensity_black", "intensity_white"];
/// The colours of the map, with what they are called.
const COLORS: [(&str, &str, ColorBy); 7] = [
    ("radius", "radius", ColorBy::Radius),
    ("branch", "branch", ColorBy::Branch),
    ("generation", "generation", ColorBy::Generation),
    (LABEL, LABEL, ColorBy::Label),
    ("angle-loss", "angle loss", ColorBy::AngleLoss),
    ("length-loss", "length loss", ColorBy::LengthLoss),
    ("orientation-loss", "lost 3D orientation", ColorBy::OrientationLoss),
];
/// The colours that only trees with labels have; their scale is a list of names.
const LABEL: &str = "label";

/// Makes the page.
pub(crate) fn report(step: &mut Step<'_>) -> Result<Outcome, Error> {
    let tree = step.take(Artifacts::tree)?;
    let views = step.take(Artifacts::views)?;
    let embedding = step.take(Artifacts::embedding)?;
    let comparison = step.take(Artifacts::comparison)?;
    let mask = if has_mask(step) { Some(step.take(Artifacts::mask)?) } else { None };
    let sizes = mask.as_deref().map(Sizes::of_mask).unwrap_or_default();
    step.must_fit(&sizes.and_tree(&tree))?;
    let is_own = is_of_folder(step.artifacts);
    let text = |file: &str| if is_own { step.folder.text_if_there(file) } else { Ok(None) };
    let rows = |file: &str| Ok::<_, Error>(text(file)?.map(|text| Rows::parse(&text)));
    let stages = stages_of(step.source);
    let said = if is_own { said(step.folder, &stages)? } else { Vec::new() };
    let ledger = text(LEDGER)?
        .map(|text| Ledger::from_tsv(&text))
        .transpose()
        .map_err(|error| Error::file(&step.folder.path().join(LEDGER), error))?;
    let facts = Facts {
        name: step.config.own_name(),
        program: concat!("espalier ", env!("CARGO_PKG_VERSION")),
        seed: step.config.seed,
        input_kind: input_kind(step.source),
        input_files: if is_own { input_files(step.folder)? } else { Vec::new() },
        slices: if is_own { read_slices(step.folder, &said)? } else { None },
        mask: mask.as_deref(),
        tree: &tree,
        views: &views,
        ledger: ledger.as_ref(),
        embedding: &embedding,
        comparison: comparison.as_deref(),
        branches: rows("branches.tsv")?,
        generations: rows("generations.tsv")?,
        stenoses: rows("stenoses.tsv")?,
        dictionary: rows("dictionary.tsv")?,
        space_png: if is_own { step.folder.checked_if_there("space.png")? } else { None },
        colorings: colorings(step, &tree, &embedding)?,
        stages: said,
        settings: listed(step, &stages),
        results_sha256: step.folder.digest_of(is_result),
    };
    let params = &step.config.report;
    let made = espalier_report::report(&facts, params).map_err(|error| step.failed(error))?;
    let mut files = vec![
        ("provenance/methods.md".to_owned(), made.methods.into_bytes()),
        ("provenance/references.bib".to_owned(), made.references.into_bytes()),
    ];
    let mut line = "methods.md, references.bib".to_owned();
    if params.enabled {
        line = format!("report.html, {:.1} MB", made.html.len() as f64 / 1e6);
        files.push(("report.html".to_owned(), made.html.into_bytes()));
    }
    Ok(Outcome { files, report: made.report, line })
}

/// The topology ledger.
pub(crate) const LEDGER: &str = "topology.tsv";

/// Slices of the scan, for the page: drawn where the scan is read, since it may not be there later. None where the input
/// is a mask or a label map, which has no more to show than its outline.
pub(crate) fn slices(
    step: &mut Step<'_>,
    mask: &Mask,
    report: &mut Report,
) -> Result<Vec<(String, Vec<u8>)>, Error> {
    if !step.config.volume.is_of_scan() {
        return Ok(Vec::new());
    }
    let scan = step.take(Artifacts::scan)?;
    let Some(mut mosaic) = Mosaic::new(scan.grid(), mask) else { return Ok(Vec::new()) };
    scan.for_each(|start, values| mosaic.see(start, values)).map_err(|error| step.failed(error))?;
    let drawn = mosaic.draw().map_err(|error| step.failed(error))?;
    let values = drawn.range.into_iter().chain(drawn.window);
    INTENSITIES.into_iter().zip(values).for_each(|(name, value)| report.count(name, value));
    let files = Slices::names().into_iter().zip(drawn.png);
    Ok(files.map(|(plane, png)| step.beside(&format!("slices-{plane}.png"), png)).collect())
}

/// Whether a file counts as a result: what the page says is one digest of them all.
fn is_result(file: &str) -> bool {
    let is_of_making = file.starts_with("provenance/") || file.ends_with("/record.json");
    !is_of_making && !Stage::Report.writes().iter().any(|own| own == file)
}

/// Whether tree and embedding are those of the folder.
pub(crate) fn is_of_folder(artifacts: &Artifacts) -> bool {
    ![Artifact::Tree, Artifact::Embedding].iter().any(|artifact| artifacts.files.contains_key(artifact))
}

/// Whether there is a mask of this tree.
pub(crate) fn has_mask(step: &Step<'_>) -> bool {
    let artifacts = &step.artifacts;
    let in_folder = || step.folder.path().join(Artifact::Mask.file()).exists();
    !step.is_traced()
        && (artifacts.mask.is_some()
            || artifacts.files.contains_key(&Artifact::Mask)
            || (is_of_folder(artifacts) && in_folder()))
}

fn input_kind(source: &Source) -> InputKind {
    match source {
        Source::Volume(_) => InputKind::Volume,
        Source::Tree(_) => InputKind::Tree,
        Source::PhantomScan(_) => InputKind::PhantomScan,
        Source::PhantomTree(_) => InputKind::PhantomTree,
    }
}

/// The content of the input's files, as provenance has it.
fn input_files(folder: &RunFolder) -> Result<Vec<InputFile>, Error> {
    let rows =
        folder.text_if_there(provenance::INPUTS_FILE)?.map(|text| Rows::parse(&text)).unwrap_or_default();
    let file = |row| InputFile {
        role: rows.text(row, "role").to_owned(),
        n_bytes: rows.text(row, "bytes").to_owned(),
        sha256: rows.text(row, "sha256").to_owned(),
    };
    Ok((0..rows.len()).map(file).collect())
}

/// The slices that the volume stage has left.
fn read_slices(folder: &RunFolder, said: &[StageFacts]) -> Result<Option<Slices>, Error> {
    let counts = said.iter().find(|facts| facts.stage == Stage::Volume.name()).map(|facts| &facts.counts);
    let value = |name: &str| counts?.iter().find(|(known, _)| known == name).map(|(_, value)| *value);
    let [Some(least), Some(most), Some(black), Some(white)] = INTENSITIES.map(value) else { return Ok(None) };
    let png = |plane: &str| folder.read(&format!("{}/slices-{plane}.png", Stage::Volume.folder()));
    let [axial, coronal, sagittal] = Slices::names().map(png);
    Ok(Some(Slices { range: [least, most], window: [black, white], png: [axial?, coronal?, sagittal?] }))
}

#[derive(Deserialize)]
struct ReportRecord {
    counts: std::collections::BTreeMap<String, Option<f64>>,
    warnings: Vec<WarningRecord>,
}

#[derive(Deserialize)]
struct WarningRecord {
    code: String,
    message: String,
}

/// What each stage before has said, from its report.
pub(crate) fn said(folder: &RunFolder, stages: &[Stage]) -> Result<Vec<StageFacts>, Error> {
    let mut said = Vec::new();
    for stage in stages.iter().filter(|stage| **stage < Stage::Report) {
        let text = folder.text_if_there(&format!("{}/report.json", stage.folder()))?;
        // A report of another version says nothing to this page.
        let Some(record) = text.and_then(|text| serde_json::from_str::<ReportRecord>(&text).ok()) else {
            continue;
        };
        let counts = record.counts.into_iter().map(|(name, value)| (name, value.unwrap_or(f64::NAN)));
        said.push(StageFacts {
            stage: stage.name().to_owned(),
            counts: counts.collect(),
            warnings: record.warnings.into_iter().map(|w| (w.code, w.message)).collect(),
        });
    }
    Ok(said)
}

fn listed(step: &Step<'_>, stages: &[Stage]) -> Vec<Setting> {
    let listed = settings::listed(step.config, stages).into_iter();
    listed.map(|(key, value, default)| Setting { key, value, default }).collect()
}

/// The colours of the map on light and on dark pages, as in the pictures.
fn colorings(step: &Step<'_>, tree: &Tree, embedding: &Embedding) -> Result<Vec<Coloring>, Error> {
    let labels = labels::labels(step, tree)?;
    let has_labels = labels.is_some() || tree.edges().any(|(node, _)| tree.nodes()[node].kind != 0);
    let table = |color_by, theme| -> Result<ColorTable, Error> {
        let labels = labels.clone();
        let params = espalier_render::Params { color_by, theme, labels, ..step.config.render.clone() };
        color_table(tree, embedding, &params).map_err(|error| step.failed(error))
    };
    let coloring = |(key, name, color_by): (&'static str, &str, ColorBy)| {
        let [light, dark] = [table(color_by, Theme::Light)?, table(color_by, Theme::Dark)?];
        Ok(Coloring {
            key,
            name: name.to_owned(),
            caption: if key == LABEL { String::new() } else { light.caption },
            light: light.colors,
            dark: dark.colors,
            bins: light.bins,
            ticks: light.ticks,
        })
    };
    COLORS.into_iter().filter(|(key, ..)| *key != LABEL || has_labels).map(coloring).collect()
}
