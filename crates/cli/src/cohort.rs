//! Many scans at one command: `espalier cohort` and `espalier bids`.

use espalier_pipeline::event_lines::{Failure, Line};
use espalier_pipeline::{
    BidsRequest, Cohort, CohortPage, CohortRequest, Effort, FailedSample, PageRequest, Sample, Turn, Word,
};
use serde_json::json;

use crate::args::{Arguments, BidsArguments, CohortArguments, PageArguments, Rerun};
use crate::commands::{cache, data_dir, half_of_memory};
use crate::progress::{self, Progress};
use crate::{failure, summary};

/// `espalier cohort`.
pub(crate) fn execute(arguments: &Arguments, cohort: &CohortArguments) -> anyhow::Result<()> {
    let request = CohortRequest {
        table: cohort.table.clone(),
        out: cohort.out.clone(),
        config: cohort.config.clone(),
        only: cohort.only.clone(),
        overrides: arguments.common.overrides.clone(),
        options: options(arguments, cohort.rerun),
        data_dir: data_dir(),
    };
    let scans = Cohort::read(&request)?;
    let effort = effort(arguments, cohort.rerun);
    if cohort.list {
        progress::result(scans.list(&effort).trim_end());
        return Ok(());
    }
    if cohort.group {
        return print_page(arguments, &scans, (&cohort.page, effort.wait));
    }
    let show = Progress::new(&arguments.common);
    let _held = scans.hold(effort.wait, &|event| show.show(event))?;
    let done = perform(arguments, &scans, &effort);
    if cohort.only.is_empty() {
        // Hours of work do not end with that somebody else looks at the page just now.
        print_page(arguments, &scans, (&cohort.page, true))?;
    }
    done
}

/// `espalier bids`.
pub(crate) fn execute_bids(arguments: &Arguments, bids: &BidsArguments) -> anyhow::Result<()> {
    let cohort = espalier_pipeline::bids(&BidsRequest {
        input: bids.input.clone(),
        out: bids.out.clone(),
        participants: bids.participant_label.clone(),
        sessions: bids.session_label.clone(),
        suffix: bids.suffix.clone(),
        filters: bids.filters.clone(),
        skip_validation: bids.skip_bids_validation,
        config: bids.config.clone(),
        overrides: arguments.common.overrides.clone(),
        options: options(arguments, bids.rerun),
        data_dir: data_dir(),
    })?;
    let effort = effort(arguments, bids.rerun);
    if bids.level == "group" {
        return print_page(arguments, &cohort, (&bids.page, effort.wait));
    }
    let show = Progress::new(&arguments.common);
    let _held = cohort.hold(effort.wait, &|event| show.show(event))?;
    for absent in &cohort.absent {
        progress::line(&format!("note: {}: {}", absent.id, absent.reason));
    }
    perform(arguments, &cohort, &effort)
}

/// The options that no result depends on, as they were given.
fn options(arguments: &Arguments, rerun: Rerun) -> Vec<Word> {
    let common = &arguments.common;
    let option = |name: &str, value: Option<String>| {
        value.map(|value| [Word::Text(name.to_owned()), Word::Text(value)]).into_iter().flatten()
    };
    let mut words: Vec<Word> = option("--threads", common.threads.map(|n| n.to_string())).collect();
    words.extend(option("--max-memory", common.max_memory.map(size)));
    if let Some(folder) = &common.cache {
        words.extend([Word::Text("--cache".to_owned()), Word::Path(folder.clone())]);
        words.extend(option("--cache-size", Some(size(common.cache_size))));
    }
    words.extend(rerun.wait.then(|| Word::Text("--wait".to_owned())));
    words
}

/// A number of bytes as an option takes it.
fn size(n_bytes: u64) -> String {
    let units = [(30, "G"), (20, "M"), (10, "K")];
    let unit = units.into_iter().find(|(shift, _)| n_bytes.is_multiple_of(1 << shift));
    unit.map_or_else(|| n_bytes.to_string(), |(shift, name)| format!("{}{name}", n_bytes >> shift))
}

/// How scans are done.
fn effort(arguments: &Arguments, rerun: Rerun) -> Effort {
    let Rerun { force, wait } = rerun;
    Effort {
        threads: arguments.common.threads.map(usize::from),
        max_memory_bytes: arguments.common.max_memory.unwrap_or_else(half_of_memory),
        data_dir: data_dir(),
        force,
        wait,
        cache: cache(arguments),
    }
}

/// Does the scans; of each its id, how it goes, and its digest or its error.
fn perform(arguments: &Arguments, cohort: &Cohort, effort: &Effort) -> anyhow::Result<()> {
    let show = Progress::new(&arguments.common);
    let n_samples = cohort.samples.len();
    let said = |sample: &Sample, turn: Turn<'_>| {
        match turn {
            Turn::Begins if arguments.common.quiet => {}
            turn if arguments.common.json => tell(sample, turn),
            Turn::Begins => progress::line(&format!("== {}", sample.id)),
            Turn::Done(summary) => progress::result(&format!("{}\tdigest {}", sample.id, summary.digest)),
            // The error of a single scan is that of the command.
            Turn::Failed(_) if n_samples == 1 => {}
            Turn::Failed(error) => {
                progress::line(&format!("{} failed", sample.id));
                failure::report(error);
            }
        }
    };
    Ok(cohort.perform(effort, &|event| show.show(event), &said)?)
}

/// Tells programs where a scan stands.
fn tell(sample: &Sample, turn: Turn<'_>) {
    let (scan, folder) = (sample.id.clone(), sample.out.display().to_string());
    progress::tell(&match turn {
        Turn::Begins => Line::ScanStarted { scan, folder },
        Turn::Done(summary) => Line::ScanDone { scan, folder, digest: summary.digest.clone() },
        Turn::Failed(error) => Line::ScanFailed { scan, folder, failure: Failure::of(error) },
    });
}

/// Makes the page and prints what it says of failures.
fn print_page(
    arguments: &Arguments,
    cohort: &Cohort,
    (page, wait): (&PageArguments, bool),
) -> anyhow::Result<()> {
    let request = PageRequest {
        title: page.title.clone(),
        is_anonymous: page.anonymous,
        threads: arguments.common.threads.map(usize::from),
        wait,
    };
    let CohortPage { table, failed, n_other_settings, failures_file, summary } = cohort.page(&request)?;
    if arguments.common.json {
        let of_scan = |failed: &FailedSample| {
            let FailedSample { id, code, reason, done_to, retry } = failed;
            json!({ "scan": id, "code": code, "reason": reason, "done_to": done_to, "retry": retry })
        };
        let mut parts = summary::of(&summary);
        parts.insert("failures_file".to_owned(), failures_file.display().to_string().into());
        parts.insert("failed".to_owned(), failed.iter().map(of_scan).collect());
        parts.insert("n_other_settings".to_owned(), n_other_settings.into());
        summary::print_json(parts);
        return Ok(());
    }
    progress::result(&table);
    for failed in &failed {
        let retry = failed.retry.as_ref().map(|retry| format!("\n    {retry}")).unwrap_or_default();
        progress::result(&format!("{}  {}  {}{retry}", failed.id, failed.code, failed.reason));
    }
    if n_other_settings > 0 {
        progress::line(&format!(
            "note: scans that were done with other settings, and do not count: {n_other_settings}; the page takes the \
             --config, --set and other options that they were done with"
        ));
    }
    progress::result(&failures_file.display().to_string());
    summary::print(&summary, false);
    Ok(())
}
