//! What each command does, by kind of command.
//!
//! | file | commands |
//! |---|---|
//! | `runs` | one run, from a config or an input; a phantom |
//! | `stages` | one stage, of a run folder or on files |
//! | `many` | several runs: compared, juxtaposed, swept, grouped |
//! | `asks` | what changes nothing: verify, doctor, profile, locate |

mod asks;
mod many;
mod runs;
mod stages;

use std::path::PathBuf;

use clap::CommandFactory;
use espalier_pipeline::{Cache, Stage};

use crate::args::{Arguments, Command};
use crate::{cohort, config, explain, info, progress, summary};

/// Memory assumed where the machine does not tell its own.
const FALLBACK_MEMORY_BYTES: u64 = 4 << 30;

/// Does what the arguments say.
pub(crate) fn execute(arguments: &Arguments) -> anyhow::Result<()> {
    let summary = match &arguments.command {
        Command::Run(run) if run.dry_run => return runs::plan(arguments, run),
        Command::Run(run) => runs::run(arguments, run)?,
        Command::Compare(compare) => many::compare(arguments, compare)?,
        Command::Juxtapose(juxtapose) => many::juxtapose(arguments, juxtapose)?,
        Command::Sweep(sweep) => many::sweep(arguments, sweep)?,
        Command::Group(group) => many::group(arguments, group)?,
        Command::Cohort(cohort) => return cohort::execute(arguments, cohort),
        Command::Bids(bids) => return cohort::execute_bids(arguments, bids),
        Command::Phantom(phantom) => runs::phantom(arguments, phantom)?,
        Command::Volume(stage) => stages::run(arguments, stage, Stage::Volume)?,
        Command::Skeleton(stage) => stages::run(arguments, stage, Stage::Skeleton)?,
        Command::Radius(stage) => stages::run(arguments, stage, Stage::Radius)?,
        Command::Tree(stage) => stages::run(arguments, stage, Stage::Tree)?,
        Command::Views(stage) => stages::run(arguments, stage, Stage::Views)?,
        Command::Embed(stage) => stages::run(arguments, stage, Stage::Embed)?,
        Command::Render(stage) => stages::run(arguments, stage, Stage::Render)?,
        Command::Report(stage) => stages::run(arguments, stage, Stage::Report)?,
        Command::Verify(verify) => return asks::verify(arguments, verify),
        Command::Profile(profile) => return asks::profile(arguments, profile),
        Command::Doctor(doctor) => return asks::doctor(arguments, doctor),
        Command::Locate(locate) => return asks::locate(arguments, locate),
        Command::Info(arguments_of_info) => return info::print(arguments, arguments_of_info),
        Command::Config(command) => return config::execute(command, arguments.common.json),
        Command::Explain(explain) => return explain::print(explain, arguments.common.json),
        Command::Completions { shell } => {
            progress::result(completions(*shell).trim_end());
            return Ok(());
        }
    };
    summary::print(&summary, arguments.common.json);
    Ok(())
}

/// The script that completes commands and options.
fn completions(shell: clap_complete::Shell) -> String {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Arguments::command(), "espalier", &mut script);
    String::from_utf8_lossy(&script).into_owned()
}

#[allow(clippy::disallowed_methods, reason = "the command line is where the environment is read")]
pub(crate) fn data_dir() -> Option<PathBuf> {
    std::env::var_os("ESPALIER_DATA").map(PathBuf::from)
}

/// The store that runs share: none unless somebody has said where it lies.
#[allow(clippy::disallowed_methods, reason = "the command line is where the environment is read")]
pub(crate) fn cache(arguments: &Arguments) -> Option<Cache> {
    let named = arguments.common.cache.clone();
    let folder = named.or_else(|| std::env::var_os("ESPALIER_CACHE").map(PathBuf::from))?;
    let max_bytes = arguments.common.cache_size;
    (!folder.as_os_str().is_empty()).then_some(Cache { folder, max_bytes })
}

/// Half of the machine's memory.
pub(crate) fn half_of_memory() -> u64 {
    let total = || -> Option<u64> {
        let text = std::fs::read_to_string("/proc/meminfo").ok()?;
        let kilobytes = text.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
        kilobytes.split_whitespace().next()?.parse::<u64>().ok().map(|kb| kb * 1024)
    };
    total().map_or(FALLBACK_MEMORY_BYTES, |bytes| bytes / 2)
}
