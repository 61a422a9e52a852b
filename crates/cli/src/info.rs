//! What this program is, what it has here, and what its lines for programs look like.

use espalier_pipeline::info::{Info, info};
use serde::Serialize;

use crate::args::{Arguments, InfoArguments};
use crate::{commands, progress};

/// What the program is, and what it would use on this machine with these options.
#[derive(Serialize)]
struct Here {
    #[serde(flatten)]
    info: Info,
    /// How many threads it works with; no result depends on it.
    threads: usize,
    /// The most memory that a stage may take, in bytes.
    max_memory_bytes: u64,
}

/// Prints what the program is.
pub(crate) fn print(arguments: &Arguments, of_info: &InfoArguments) -> anyhow::Result<()> {
    if of_info.events {
        progress::result(espalier_pipeline::event_lines::schema_text().trim_end());
        return Ok(());
    }
    let per_core = || std::thread::available_parallelism().map_or(1, usize::from);
    let here = Here {
        info: info(),
        threads: arguments.common.threads.map_or_else(per_core, usize::from),
        max_memory_bytes: arguments.common.max_memory.unwrap_or_else(commands::half_of_memory),
    };
    progress::result(&if arguments.common.json { serde_json::to_string_pretty(&here)? } else { page(&here) });
    Ok(())
}

fn page(here: &Here) -> String {
    let Here { info, threads, max_memory_bytes } = here;
    let target = &info.target;
    let kind = if target.is_debug { ", debug build" } else { "" };
    let mut lines = vec![
        format!("espalier {}", info.version),
        format!("target     {} {}{kind}, features: {}", target.arch, target.os, listed(&target.features)),
        format!("threads    {threads} (no result depends on it)"),
        format!("memory     {:.1} GiB at most for a stage", *max_memory_bytes as f64 / f64::from(1 << 30)),
        format!("config     schema {}", info.config_schema),
        String::new(),
        "stages     version of what they make".to_owned(),
    ];
    lines.extend(info.stages.iter().map(|stage| format!("  {:<9}{}", stage.name, stage.version)));
    lines.extend([String::new(), "reads".to_owned()]);
    lines.extend(
        info.reads.iter().map(|reader| format!("  {:<10}{}: {}", reader.format, reader.files, reader.reads)),
    );
    lines.extend([String::new(), "limits".to_owned()]);
    lines.extend(info.limits.iter().map(|limit| format!("  {:<20}{}", limit.name, limit.value)));
    lines.join("\n")
}

fn listed(names: &[&str]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}
