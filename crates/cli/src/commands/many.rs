//! Several runs: side by side, against each other, at many settings, on one page.

use std::path::Path;

use espalier_pipeline::{
    Align, ChangeOf, CompareRequest, GroupRequest, JuxtaposeParams, JuxtaposeRequest, Override, Subject,
    Summary, SweepRequest,
};

use super::runs::load;
use super::stages::is_run;
use super::{cache, data_dir, half_of_memory};
use crate::args::{Arguments, CompareArguments, GroupArguments, JuxtaposeArguments, SweepArguments};
use crate::progress::{self, Progress};
use crate::summary;

pub(super) fn compare(arguments: &Arguments, compare: &CompareArguments) -> anyhow::Result<Summary> {
    let overrides = &arguments.common.overrides;
    let subjects = compare.subjects.iter().map(|path| subject(path, overrides));
    let request = CompareRequest {
        subjects: subjects.collect::<anyhow::Result<_>>()?,
        out: compare.out.clone(),
        overrides: overrides.clone(),
        threads: arguments.common.threads.map(usize::from),
        max_memory_bytes: arguments.common.max_memory.unwrap_or_else(half_of_memory),
        data_dir: data_dir(),
        cache: cache(arguments),
    };
    let progress = Progress::new(&arguments.common);
    let compared = espalier_pipeline::compare(&request, &|event| progress.show(event))?;
    summary::table(&compared.table, arguments.common.json);
    Ok(compared.summary)
}

/// A run folder, or an input or config to be run.
fn subject(path: &Path, overrides: &[Override]) -> anyhow::Result<Subject> {
    // A folder that is no run but has DICOM slices in it is an input.
    let is_input = !is_run(path) && espalier_pipeline::is_dicom_folder(path);
    if path.is_dir() && !is_input {
        return Ok(Subject::Run(path.to_owned()));
    }
    load(path, overrides).map(|loaded| Subject::Config(Box::new(loaded)))
}

pub(super) fn juxtapose(arguments: &Arguments, juxtapose: &JuxtaposeArguments) -> anyhow::Result<Summary> {
    let overrides = &arguments.common.overrides;
    let align = Align::ALL.into_iter().find(|align| align.name() == juxtapose.align).unwrap_or_default();
    let request = JuxtaposeRequest {
        subjects: [subject(&juxtapose.baseline, overrides)?, subject(&juxtapose.followup, overrides)?],
        out: juxtapose.out.clone(),
        overrides: overrides.clone(),
        params: JuxtaposeParams { align, ..JuxtaposeParams::default() },
        change: if juxtapose.change == "length" { ChangeOf::Length } else { ChangeOf::Radius },
        threads: arguments.common.threads.map(usize::from),
        max_memory_bytes: arguments.common.max_memory.unwrap_or_else(half_of_memory),
        data_dir: data_dir(),
        cache: cache(arguments),
    };
    let progress = Progress::new(&arguments.common);
    let compared = espalier_pipeline::juxtapose(&request, &|event| progress.show(event))?;
    summary::table(&compared.table, arguments.common.json);
    Ok(compared.summary)
}

pub(super) fn sweep(arguments: &Arguments, sweep: &SweepArguments) -> anyhow::Result<Summary> {
    let request = SweepRequest {
        config_or_input: sweep.config_or_input.clone(),
        overrides: arguments.common.overrides.clone(),
        axes: sweep.axes.clone(),
        out: sweep.out.clone(),
        threads: arguments.common.threads.map(usize::from),
        max_memory_bytes: arguments.common.max_memory.unwrap_or_else(half_of_memory),
        data_dir: data_dir(),
        cache: cache(arguments),
    };
    let progress = Progress::new(&arguments.common);
    let swept = espalier_pipeline::sweep(&request, &|event| progress.show(event))?;
    summary::table(&swept.table, arguments.common.json);
    Ok(swept.summary)
}

pub(super) fn group(arguments: &Arguments, group: &GroupArguments) -> anyhow::Result<Summary> {
    let request = GroupRequest {
        folders: group.folders.clone(),
        out: group.out.clone(),
        title: group.title.clone(),
        is_anonymous: group.anonymous,
        threads: arguments.common.threads.map(usize::from),
    };
    let grouped = espalier_pipeline::group(&request)?;
    grouped.notes.iter().for_each(|note| progress::line(&format!("note: {note}")));
    summary::table(&grouped.table, arguments.common.json);
    Ok(grouped.summary)
}
