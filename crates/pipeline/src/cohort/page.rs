//! What a cohort has come to: the page over all its scans, and the list of those that failed.
//!
//! **Input** the scans. **Output** `group/`, as [`group`](mod@crate::group) makes it, with the commands of the cohort in
//! place of those of a run; `failures.tsv`, whose commands are as they would be typed.
//! **Guarantees** a scan whose last run did not come to its end with its present settings is listed, whatever older results
//! lie in its folder. No path of a machine is in `group/`; `failures.tsv`, which no digest covers, has those that were typed.

use std::path::PathBuf;

use espalier_model::table::{Column, Table};
use espalier_report::group::{Failed, GroupOutcome, GroupRun};

use super::done::Standing;
use super::{Absent, Cohort, Sample};
use crate::error::Error;
use crate::folder::write_file;
use crate::group::{self, GroupPage, Member};
use crate::run::Summary;

const FAILURES_FILE: &str = "failures.tsv";
const COLUMNS: [Column; 5] = [
    Column::new("id", "n/a", "the scan"),
    Column::new("code", "n/a", "the code of the error"),
    Column::new("reason", "n/a", "the stage that failed, and what kind of error it is"),
    Column::new("done_to", "n/a", "the last stage whose results are there"),
    Column::new("retry", "n/a", "the command that does the scan alone"),
];

/// How the page is to be.
#[derive(Clone, Debug, Default)]
pub struct PageRequest {
    /// The heading.
    pub title: Option<String>,
    /// Whether scans are numbered in place of their ids.
    pub is_anonymous: bool,
    /// Threads; `None` for one per core.
    pub threads: Option<usize>,
    /// Whether to wait for another call that makes the page, rather than to stop.
    pub wait: bool,
}

/// What a cohort has come to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CohortPage {
    /// The sums, for a terminal.
    pub table: String,
    /// The scans without a map, in the order of the table.
    pub failed: Vec<FailedSample>,
    /// How many scans were done with other settings than the page was asked for with.
    pub n_other_settings: usize,
    /// Where they are listed.
    pub failures_file: PathBuf,
    /// The folder of the page and its digest.
    pub summary: Summary,
}

/// A scan without a map.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FailedSample {
    /// Its id.
    pub id: String,
    /// The code of the error.
    pub code: String,
    /// What kind of error it is, at which stage.
    pub reason: String,
    /// The last stage whose results are there.
    pub done_to: Option<String>,
    /// The command that does it alone; none where there is nothing to do.
    pub retry: Option<String>,
}

impl Cohort {
    /// Makes page and list from what lies in the run folders.
    ///
    /// # Errors
    /// [`Error`] if the results cannot be written. A scan that failed is no error: it is listed.
    pub fn page(&self, request: &PageRequest) -> Result<CohortPage, Error> {
        let numbered = request.is_anonymous.then(|| group::numbered(self.samples.len() + self.absent.len()));
        let member = |(idx, sample): (usize, &Sample)| Member {
            label: numbered.as_ref().map_or(&sample.id, |labels| &labels[idx]).clone(),
            folder: sample.out.clone(),
            failed: sample.trouble(),
            retry: Some(sample.retry.shown.clone()).filter(|_| !request.is_anonymous),
        };
        let mut members: Vec<Member> = self.samples.iter().enumerate().map(member).collect();
        members.extend(self.absent.iter().enumerate().map(|(idx, absent)| {
            let label =
                numbered.as_ref().map_or(&absent.id, |labels| &labels[self.samples.len() + idx]).clone();
            Member { label, folder: PathBuf::new(), failed: Some(without_scan(absent)), retry: None }
        }));
        let title = request.title.as_deref().filter(|title| !title.trim().is_empty());
        let shown = group::show(
            &members,
            &GroupPage {
                out: &self.out.join("group"),
                title: title.unwrap_or("Cohort"),
                threads: request.threads,
                wait: request.wait,
            },
        )?;
        let mut failed: Vec<FailedSample> = self.samples.iter().zip(&shown.runs).filter_map(failed).collect();
        failed.extend(self.absent.iter().map(|absent| FailedSample {
            id: absent.id.clone(),
            code: absent.code.to_owned(),
            reason: absent.reason.clone(),
            done_to: None,
            retry: None,
        }));
        let failures_file = self.out.join(FAILURES_FILE);
        write_file(&failures_file, tsv(&failed).as_bytes())?;
        let is_other = |sample: &&Sample| sample.standing() == Standing::OtherSettings;
        let n_other_settings = self.samples.iter().filter(is_other).count();
        Ok(CohortPage { table: shown.table, failed, n_other_settings, failures_file, summary: shown.summary })
    }
}

fn without_scan(absent: &Absent) -> Failed {
    Failed { code: absent.code.to_owned(), reason: absent.reason.clone(), done_to: None, retry: None }
}

fn failed((sample, run): (&Sample, &GroupRun)) -> Option<FailedSample> {
    let GroupOutcome::Failed(failed) = &run.outcome else { return None };
    Some(FailedSample {
        id: sample.id.clone(),
        code: failed.code.clone(),
        reason: failed.reason.clone(),
        done_to: failed.done_to.clone(),
        retry: Some(sample.retry.typed.clone()),
    })
}

fn tsv(failed: &[FailedSample]) -> String {
    let mut table = Table::with(&COLUMNS);
    for FailedSample { id, code, reason, done_to, retry } in failed {
        let or_none = |text: &Option<String>| text.clone().unwrap_or_else(|| "n/a".to_owned());
        table.row_of(&[id.clone(), code.clone(), reason.clone(), or_none(done_to), or_none(retry)]);
    }
    table.into_string()
}
