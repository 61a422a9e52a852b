//! A phantom, as a scan or as a traced tree.

use espalier_model::Report;

use super::{Outcome, Step, describe_grid};
use crate::config::Source;
use crate::error::Error;
use crate::phantom;
use crate::stage::Stage;

pub(super) fn phantom(step: &mut Step<'_>) -> Result<Outcome, Error> {
    let (kind, scanned) = match *step.source {
        Source::PhantomScan(kind) => (kind, true),
        Source::PhantomTree(kind) => (kind, false),
        Source::Volume(_) | Source::Tree(_) => {
            let available = "volume to render".to_owned();
            return Err(Error::NoSuchStage { flag: "from", stage: Stage::Phantom, available });
        }
    };
    let made = phantom::make(kind, step.config, scanned)?;
    let mut report = Report::default();
    report.count_usize("nodes", made.tree.n_nodes());
    report.count_usize("tips", made.tree.n_tips());
    let mut line = format!("{}: {} nodes, {} tips", kind.name(), made.tree.n_nodes(), made.tree.n_tips());
    if let Some(scan) = &made.scan {
        report.count_usize("voxels", scan.grid().n_voxels());
        line = format!("{line}, {}", describe_grid(scan.grid()));
    }
    let files = made.files()?.into_iter().map(|(name, bytes)| step.beside(name, bytes)).collect();
    Ok(Outcome { files, report, line })
}
