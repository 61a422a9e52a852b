//! What the files of a folder claim, computed again from what they hold.

use std::path::Path;

use espalier_embed::CrossingWeight;
use espalier_model::{Comparison, Embedding, FileError, Tree, ViewHierarchy, swc};
use espalier_verify::{
    Check, Claim, Rule, Weights, check_compare_table, check_comparison, check_embedding, check_header,
    check_nodes_table,
};

use super::{COMPARE, CONFIG, DICTIONARY, Folder, Has, NODES};
use crate::config::Config;
use crate::error::Error;
use crate::stage::{Artifact, Stage};

/// Checks with the files that make the claims.
type Checks = Vec<(String, Check)>;

impl Folder<'_> {
    /// Everything that can be computed again, as far as the run has come.
    pub(super) fn check_contents(&self, has: &Has, checks: &mut Checks) -> Result<(), Error> {
        self.check_headers(has, checks)?;
        if !has.is_run {
            return Ok(());
        }
        for (stage, artifact) in [
            (Stage::Tree, Artifact::Tree),
            (Stage::Views, Artifact::Views),
            (Stage::Embed, Artifact::Embedding),
        ] {
            if !has.stages.contains(&stage) {
                let why = format!("{stage} was not done here");
                checks.push((artifact.file().to_owned(), Check::untested("results", "yes", &why)));
            }
        }
        let config = self.parsed(CONFIG, checks, |text| {
            Config::parse(text, Path::new(CONFIG), &[])
                .map_err(|error| format!("no config of this version: {error}"))
        })?;
        let read = |text: &str| swc::read_tree(text).map_err(|error| error.to_string());
        let tree = if has.stages.contains(&Stage::Tree) {
            self.parsed(Artifact::Tree.file(), checks, read)?
        } else {
            None
        };
        let (Some(config), Some(tree)) = (config, tree) else { return Ok(()) };
        self.check_layout(has, (&config, &tree), checks)
    }

    /// Views and embedding against the tree.
    fn check_layout(
        &self,
        has: &Has,
        (config, tree): (&Config, &Tree),
        checks: &mut Checks,
    ) -> Result<(), Error> {
        let has_views = has.stages.contains(&Stage::Views);
        let views = |text: &str| ViewHierarchy::from_json(text, tree);
        let views = if has_views { self.of_tree(Artifact::Views, checks, views)? } else { None };
        if !has.stages.contains(&Stage::Embed) {
            return Ok(());
        }
        let embedding = self.of_tree(Artifact::Embedding, checks, |text| Embedding::from_json(text, tree))?;
        let comparison =
            self.of_tree(Artifact::Comparison, checks, |text| Comparison::from_json(text, tree))?;
        let Some(embedding) = embedding.filter(|_| views.is_some() || !has_views) else { return Ok(()) };

        let weights = weights(config);
        let must_be_best = config.embed.method.is_optimiser();
        let claim =
            Claim { tree, views: views.as_ref(), embedding: &embedding, weights: &weights, must_be_best };
        let mut add = |file: &str, found: Vec<Check>| {
            checks.extend(found.into_iter().map(|check| (file.to_owned(), check)));
        };
        add(Artifact::Embedding.file(), check_embedding(&claim));
        if let Some(comparison) = &comparison {
            add(Artifact::Comparison.file(), check_comparison(&claim, comparison));
        }
        let seed = usize::try_from(config.seed).unwrap_or(usize::MAX);
        let embedded = usize::try_from(embedding.seed).unwrap_or(usize::MAX);
        add(CONFIG, vec![Check::same("seed", seed, embedded)]);
        if let Some(nodes) = self.parsed(NODES, checks, |text| Ok(text.to_owned()))? {
            checks.push((NODES.to_owned(), check_nodes_table(&nodes, tree, &embedding)));
        }
        if let Some(rows) = self.parsed(COMPARE, checks, |text| Ok(text.to_owned()))? {
            checks.push((COMPARE.to_owned(), check_compare_table(&rows, &embedding.methods)));
        }
        Ok(())
    }

    /// The columns of each table of the list against the dictionary.
    fn check_headers(&self, has: &Has, checks: &mut Checks) -> Result<(), Error> {
        if !self.0.join(DICTIONARY).exists() {
            let why = "the folder has no dictionary.tsv";
            let untested = |file: &String| (file.clone(), Check::untested("columns", "as explained", why));
            checks.extend(has.tables.iter().map(untested));
            return Ok(());
        }
        let dictionary = self.parsed(DICTIONARY, checks, |text| Ok(text.to_owned()))?;
        let Some(dictionary) = dictionary else { return Ok(()) };
        for file in &has.tables {
            let name = Path::new(file).file_name().and_then(|name| name.to_str()).unwrap_or(file);
            if let Some(text) = self.parsed(file, checks, |text| Ok(text.to_owned()))? {
                checks.push((file.clone(), check_header(&dictionary, &[file, name], &text)));
            }
        }
        Ok(())
    }

    /// What a file holds; nothing, and a check that fails, if it cannot be read as what it should be.
    fn parsed<T>(
        &self,
        file: &str,
        checks: &mut Checks,
        parse: impl FnOnce(&str) -> Result<T, String>,
    ) -> Result<Option<T>, Error> {
        match self.text(file)?.and_then(|text| parse(&text)) {
            Ok(parsed) => Ok(Some(parsed)),
            Err(fault) => {
                checks.push((file.to_owned(), Check::unless("readable", "yes", Some(fault))));
                Ok(None)
            }
        }
    }

    /// What a file says of the tree; nothing, and a check that fails, if it was made for another tree, or cannot be read.
    fn of_tree<T>(
        &self,
        artifact: Artifact,
        checks: &mut Checks,
        parse: impl FnOnce(&str) -> Result<T, FileError>,
    ) -> Result<Option<T>, Error> {
        let file = artifact.file();
        let check = match self.text(file)?.map(|text| parse(&text)) {
            Ok(Ok(parsed)) => return Ok(Some(parsed)),
            Ok(Err(FileError::OtherTree { found, expected, .. })) => Check::same("tree", found, expected),
            Ok(Err(error)) => Check::unless("readable", "yes", Some(error.to_string())),
            Err(fault) => Check::unless("readable", "yes", Some(fault)),
        };
        checks.push((file.to_owned(), check));
        Ok(None)
    }
}

/// The weights of the energy in the checker's terms.
fn weights(config: &Config) -> Weights {
    let params = &config.embed;
    let rule = |rule: &espalier_embed::WeightRule| Rule {
        generations: rule.generations.map(|[first, last]| (first, last)),
        depth_mm: rule.depth_mm.map(|[least, most]| (least, most)),
        branches: rule.branches.clone(),
        nodes: rule.nodes.clone(),
        length: rule.w_length,
        angle: rule.w_angle,
    };
    Weights {
        length: params.w_length,
        angle: params.w_angle,
        side: params.w_side,
        placement: params.w_placement,
        crossing: match params.w_crossing {
            CrossingWeight::Auto => None,
            CrossingWeight::Fixed(weight) => Some(weight),
        },
        rules: params.weights.iter().map(rule).collect(),
    }
}
