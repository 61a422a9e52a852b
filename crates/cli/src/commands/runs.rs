//! One run, from a config or from an input with every setting at its default; and a phantom to run.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use espalier_pipeline::{Config, Error, Loaded, Override, Plan, Reason, Request, Summary};

use super::{cache, data_dir, half_of_memory};
use crate::args::{Arguments, PhantomArguments, Rerun, RunArguments};
use crate::progress::{self, Progress};
use crate::summary;

pub(super) fn run(arguments: &Arguments, run: &RunArguments) -> anyhow::Result<Summary> {
    perform(arguments, &pipeline_request(arguments, run)?)
}

fn pipeline_request(arguments: &Arguments, run: &RunArguments) -> anyhow::Result<Request> {
    let loaded = load(&run.config_or_input, &arguments.common.overrides)?;
    let out = run.out.clone().unwrap_or_else(|| espalier_pipeline::run::default_folder(&loaded.config));
    let Rerun { force, wait } = run.rerun;
    Ok(Request { from: run.from, to: run.to, force, wait, ..request(arguments, loaded, out) })
}

/// Prints which stages a run would do, and why.
pub(super) fn plan(arguments: &Arguments, run: &RunArguments) -> anyhow::Result<()> {
    let plans = espalier_pipeline::plan(&pipeline_request(arguments, run)?)?;
    if arguments.common.json {
        progress::result(&summary::plan(&plans));
        return Ok(());
    }
    let costs: Vec<_> = plans.iter().filter_map(|plan| Some((plan.stage, plan.cost?))).collect();
    for Plan { stage, reason, is_shared, .. } in plans {
        let text = match reason {
            None => "kept".to_owned(),
            Some(reason @ Reason::After { .. }) => format!("to do if that changes: {reason}"),
            Some(reason) if is_shared => format!("to copy from the cache: {reason}"),
            Some(reason) => format!("to do: {reason}"),
        };
        progress::result(&format!("{stage:<9} {text}"));
    }
    if !costs.is_empty() {
        progress::result("");
        progress::result(espalier_pipeline::costs_table(&costs).trim_end());
    }
    Ok(())
}

pub(super) fn phantom(arguments: &Arguments, phantom: &PhantomArguments) -> anyhow::Result<Summary> {
    let mut overrides = vec![
        Override { key: "input.phantom".to_owned(), value: phantom.kind.clone() },
        Override { key: "seed".to_owned(), value: phantom.seed.to_string() },
    ];
    overrides.extend(arguments.common.overrides.iter().cloned());
    let text = "schema = 1\n[input]\nphantom = \"airway\"\n";
    let config = Config::parse(text, Path::new("command line"), &overrides).map_err(Error::from)?;
    let threads = arguments.common.threads.map(usize::from);
    Ok(espalier_pipeline::make_phantom(&config, &phantom.out, threads)?)
}

pub(super) fn request(arguments: &Arguments, loaded: Loaded, out: PathBuf) -> Request {
    Request {
        loaded,
        out,
        from: None,
        to: None,
        files: BTreeMap::new(),
        force: false,
        wait: false,
        threads: arguments.common.threads.map(usize::from),
        max_memory_bytes: arguments.common.max_memory.unwrap_or_else(half_of_memory),
        data_dir: data_dir(),
        cache: cache(arguments),
    }
}

pub(super) fn perform(arguments: &Arguments, request: &Request) -> anyhow::Result<Summary> {
    let progress = Progress::new(&arguments.common);
    Ok(espalier_pipeline::run(request, &|event| progress.show(event))?)
}

/// A config file, or an input with every setting at its default.
pub(super) fn load(path: &Path, overrides: &[Override]) -> anyhow::Result<Loaded> {
    Ok(Loaded::read(path, overrides)?)
}

pub(super) fn load_input(path: &Path, overrides: &[Override]) -> anyhow::Result<Loaded> {
    let config = Config::for_input(path, overrides).map_err(Error::from)?;
    Ok(Loaded { config, base_dir: PathBuf::new() })
}
