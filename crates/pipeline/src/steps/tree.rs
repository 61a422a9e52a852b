//! Mask, skeleton and spheres, or a traced tree → one rooted tree, measured.

use std::sync::Arc;

use espalier_model::{Ledger, LedgerKind, Report, Tree, swc};

use super::{Outcome, Step};
use crate::artifacts::{Artifacts, SOURCE_KEY, SOURCE_SCAN, SOURCE_TRACING};
use crate::dictionary;
use crate::error::Error;
use crate::estimate::Sizes;
use crate::stage::Artifact;
use crate::tree_outputs::{self, Made};

pub(super) fn tree(step: &mut Step<'_>) -> Result<Outcome, Error> {
    let params = &step.config.tree;
    let mut ledger = Ledger::default();
    let mut scan = None;
    let (built, mut report) = if step.is_traced() {
        let (traced, report) = step.take(Artifacts::traced)?;
        step.must_fit(&Sizes { nodes: traced.nodes.len() as u64, ..Sizes::default() })?;
        (espalier_tree::from_traced(&traced, params).map_err(|error| step.failed(error))?, report)
    } else {
        let mask = step.take(Artifacts::mask)?;
        step.must_fit(&Sizes::of_mask(&mask))?;
        let skeleton = step.take(Artifacts::skeleton)?;
        let spheres = step.take(Artifacts::spheres)?;
        ledger = step.take(Artifacts::dropped)?;
        let built =
            espalier_tree::build(&mask, &skeleton, &spheres, params).map_err(|error| step.failed(error))?;
        scan = Some((mask, spheres));
        (built, Report::default())
    };
    report.extend(built.report);
    if step.artifacts.is_unit_guessed {
        warn_of_unit(&built.tree, &mut report);
    }
    let is_of_scan = !step.is_traced();
    let source = if is_of_scan { SOURCE_SCAN } else { SOURCE_TRACING };
    let text = swc::write(&built.tree, &[(SOURCE_KEY, source)]);
    step.artifacts.is_of_scan = is_of_scan;
    let tree = step.read_back(&text, swc::read_tree)?;
    let line = format!(
        "{} nodes, {} branches, {} tips, {}{}",
        tree.n_nodes(),
        tree.branches().list().len(),
        tree.n_tips(),
        readable_length(tree.length_mm()),
        ledger_phrase(&built.ledger)
    );
    ledger.0.extend(built.ledger.0);
    let labels = step.take(|artifacts, lookup| artifacts.label_map(lookup, params.label_reach_mm))?;
    let scan = scan.as_ref().map(|(mask, spheres)| (&**mask, &**spheres));
    let made = Made { tree: &tree, scan, labels, params };
    let mut files = tree_outputs::files(&made, &mut report, |error| step.failed(error))?;
    files.extend([
        step.place(Artifact::Tree, text.into_bytes()),
        ("topology.tsv".to_owned(), ledger.to_tsv().into_bytes()),
        ("dictionary.tsv".to_owned(), dictionary::text().into_bytes()),
    ]);
    step.artifacts.tree = Some(Arc::new(tree));
    Ok(Outcome { files, report, line })
}

/// Warns of a traced tree too large for a neuron where nobody has said what its unit is.
fn warn_of_unit(tree: &Tree, report: &mut Report) {
    if let Some(found) = too_large_for_a_neuron(tree) {
        let way_out = "if it is in voxels, nm or mm, set input.unit or input.scale";
        report.warn(
            "W-SWC-UNIT",
            format!("taken as µm, the tree is {found}, more than neurons are: {way_out}"),
        );
    }
}

/// How a tree is larger than neurons are; none if it is not.
pub(crate) fn too_large_for_a_neuron(tree: &Tree) -> Option<String> {
    /// Few neurons spread over more than some centimetres.
    const LARGEST_EXTENT_MM: f64 = 100.0;
    /// Somata apart, neurites of mammals and flies stay below 0.01 mm; a tracing in voxels of 8 nm has 0.04.
    const LARGEST_MEAN_RADIUS_MM: f64 = 0.02;
    let (extent_mm, radius_mm) = (2.0 * tree.extent_mm(), tree.mean_radius_mm());
    if extent_mm > LARGEST_EXTENT_MM {
        Some(format!("{extent_mm:.0} mm across"))
    } else {
        (radius_mm > LARGEST_MEAN_RADIUS_MM).then(|| format!("{:.0} µm thick on average", 2000.0 * radius_mm))
    }
}

fn readable_length(length_mm: f64) -> String {
    if length_mm >= 1.0 { format!("{length_mm:.1} mm") } else { format!("{:.1} µm", length_mm * 1000.0) }
}

/// What the ledger holds, as a phrase: `; 3 loop_cut, 12 spur_pruned`.
fn ledger_phrase(ledger: &Ledger) -> String {
    let mut kinds: Vec<_> = ledger.0.iter().map(|entry| entry.kind).collect();
    kinds.sort_unstable();
    kinds.dedup();
    // There is always a root.
    kinds.retain(|&kind| kind != LedgerKind::RootChosen);
    let phrases: Vec<String> = kinds
        .iter()
        .map(|kind| format!("{} {}", ledger.n_of(*kind), kind.name().replace('_', " ")))
        .collect();
    if phrases.is_empty() { String::new() } else { format!("; {}", phrases.join(", ")) }
}
