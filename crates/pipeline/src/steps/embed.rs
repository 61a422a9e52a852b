//! Tree and views → planar embedding, and all methods beside it.

use std::sync::Arc;

use espalier_embed::PoseMode;
use espalier_model::table::{Column, Table, fixed};
use espalier_model::{Comparison, Embedding, MethodRow, Termination, TracePoint};

use super::{Outcome, Step};
use crate::artifacts::Artifacts;
use crate::dictionary;
use crate::error::Error;
use crate::estimate::Sizes;
use crate::methods::MethodWatch;
use crate::stage::Artifact;

pub(super) fn embed(step: &mut Step<'_>) -> Result<Outcome, Error> {
    let tree = step.take(Artifacts::tree)?;
    step.must_fit(&Sizes::default().and_tree(&tree))?;
    let views = step.take(Artifacts::views)?;
    let mut params = step.config.embed.clone();
    if params.pose == PoseMode::Auto {
        params.pose = if step.artifacts.is_of_scan { PoseMode::View } else { PoseMode::RootOnTop };
    }
    if let Some((towards_camera, up)) = step.artifacts.marino_axes()? {
        (params.marino.towards_camera, params.marino.up) = (towards_camera.to_array(), up.to_array());
    }
    let edits = step.artifacts.edits(&tree)?;
    let (seed, watch) = (step.config.seed, MethodWatch::new(step.stage, step.events));
    let hear = |event| watch.hear(event);
    let embedded = espalier_embed::embed_edited((&tree, &views), &edits, &params, seed, &hear)
        .map_err(|error| step.failed(error))?;
    step.parts = watch.into_costs();
    let json = embedded.embedding.to_json();
    let embedding = step.read_back(&json, |text| Embedding::from_json(text, &tree))?;
    let compared_json = embedded.comparison.to_json();
    let comparison = step.read_back(&compared_json, |text| Comparison::from_json(text, &tree))?;
    let line = embedding_phrase(&embedding);
    let files = vec![
        ("nodes.tsv".to_owned(), embedding.nodes_tsv(&tree).into_bytes()),
        ("compare.tsv".to_owned(), MethodRow::to_tsv(&embedding.methods).into_bytes()),
        ("dictionary.tsv".to_owned(), dictionary::text().into_bytes()),
        step.beside("convergence.tsv", convergence_tsv(&embedded.comparison).into_bytes()),
        step.place(Artifact::Embedding, json.into_bytes()),
        step.place(Artifact::Comparison, compared_json.into_bytes()),
    ];
    step.artifacts.comparison = Some(Arc::new(comparison));
    step.artifacts.embedding = Some(Arc::new(embedding));
    Ok(Outcome { files, report: embedded.report, line })
}

fn embedding_phrase(embedding: &Embedding) -> String {
    let certificate = &embedding.certificate;
    let verdict = if certificate.holds() { "certified" } else { "not planar" };
    let is_optimal = embedding.termination == Termination::Optimal;
    let optimal = if is_optimal { ", proven optimal" } else { "" };
    // The published baselines; `compare.tsv` has all.
    let is_baseline = |row: &MethodRow| row.method.starts_with("marino") || row.method == "radial";
    let mut others: Vec<String> = embedding
        .methods
        .iter()
        .filter(|row| is_baseline(row) && row.method != embedding.method && row.crossings == 0)
        .map(|row| format!("{} {:.1}°", row.method, row.losses.angle3d_error_mean_deg))
        .collect();
    others.sort();
    let others = if others.is_empty() { String::new() } else { format!("  ({})", others.join(", ")) };
    let n_removed: usize = embedding.edits.iter().map(|record| record.crossings_removed).sum();
    let edits = match embedding.edits.len() {
        0 => String::new(),
        n_edits => format!("  edits {n_edits} ({n_removed} crossings removed)"),
    };
    format!(
        "crossings {} ({verdict}{optimal}){edits}  length loss {:.1} %  angle loss {:.1}°{others}",
        certificate.crossings,
        100.0 * embedding.losses.length_loss_mean,
        embedding.losses.angle3d_error_mean_deg,
    )
}

/// The columns of `convergence.tsv`.
pub(crate) const CONVERGENCE_COLUMNS: [Column; 7] = [
    Column::new("method", "n/a", "the method, as in compare.tsv"),
    Column::new("targets", "n/a", "the targets that it was scored against"),
    Column::new("phase", "n/a", "what had just been done"),
    Column::new("iteration", "1", "iteration of the method; 0 is the start"),
    Column::new(
        "evaluations",
        "1",
        "work so far: evaluations of a particle for a swarm, edges looked at for the solver",
    ),
    Column::new("energy", "1", "the best energy so far"),
    Column::new("crossings", "pairs", "the crossings of that best"),
];

/// The convergence curves of the methods that search: the best energy so far and its crossings.
fn convergence_tsv(comparison: &Comparison) -> String {
    let mut table = Table::with(&CONVERGENCE_COLUMNS);
    for layout in &comparison.layouts {
        for point in &layout.trace {
            let TracePoint { phase, iteration, evaluations, energy, crossings } = point;
            let (method, targets) = (&layout.row.method, layout.row.targets.name());
            table.row(&[
                method,
                &targets,
                &phase.name(),
                iteration,
                evaluations,
                &fixed(*energy, 9),
                crossings,
            ]);
        }
    }
    table.into_string()
}
