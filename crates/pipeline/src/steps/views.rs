//! Tree → views and local planes.

use std::sync::Arc;

use espalier_model::ViewHierarchy;

use super::{Outcome, Step};
use crate::artifacts::Artifacts;
use crate::error::Error;
use crate::estimate::Sizes;
use crate::stage::Artifact;

pub(super) fn views(step: &mut Step<'_>) -> Result<Outcome, Error> {
    let tree = step.take(Artifacts::tree)?;
    step.must_fit(&Sizes::default().and_tree(&tree))?;
    let found = espalier_views::find_views(&tree, &step.config.views, step.config.seed)
        .map_err(|error| step.failed(error))?;
    let json = found.hierarchy.to_json();
    let hierarchy = step.read_back(&json, |text| ViewHierarchy::from_json(text, &tree))?;
    let line = format!(
        "global loss {:.3}, {} subtree views, {} planes",
        hierarchy.global.loss,
        hierarchy.subtrees.len(),
        hierarchy.chains.len() + hierarchy.forks.iter().flatten().count()
    );
    step.artifacts.views = Some(Arc::new(hierarchy));
    let files = vec![step.place(Artifact::Views, json.into_bytes())];
    Ok(Outcome { files, report: found.report, line })
}
