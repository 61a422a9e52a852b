//! One page over many runs.
//!
//! **Input** run folders, or folders that have run folders in them. **Output** in a folder of its own: `group.html`,
//! `group.tsv`, `group.json`, `dictionary.tsv`, sealed by `SHA256SUMS`.
//! **Steps** 1. The run folders, each once. 2. A label for each. 3. Of each run its tree, its map and what its stages
//! said, every file checked against the run's digests; what cannot be read makes it a failure with its code, not an end of
//! the whole. 4. Page and tables.
//! **Guarantees** nothing of a run but its label, numbers, digests and a picture of its map: neither the name in its
//! config nor any path of its input. The label is what the user has typed, as far as it tells runs apart, and no folder
//! above it; `is_anonymous` numbers the runs instead. The same bytes at any number of threads.
//! **Cost** memory for one tree a thread, and the pictures.

mod labels;
mod read;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use espalier_report::group::{Failed, GroupOutcome, GroupRun};
use rayon::prelude::*;

use crate::error::Error;
use crate::folder::RunFolder;
use crate::lock::Patience;
use crate::run::{Summary, in_pool};
use crate::settings;

pub(crate) use labels::numbered;

/// The most runs on a page.
pub(crate) const MOST_RUNS: usize = 10_000;
/// Side of a map in pixels, by how many runs there are at most: the page must pass as an attachment.
const SIDES_PX: [(usize, u32); 4] = [(24, 320), (100, 220), (400, 150), (usize::MAX, 96)];

/// A group to be shown.
#[derive(Clone, Debug)]
pub struct GroupRequest {
    /// Run folders, or folders that have run folders in them.
    pub folders: Vec<PathBuf>,
    /// Where the results go.
    pub out: PathBuf,
    /// The heading; "Group of runs" if nobody says.
    pub title: Option<String>,
    /// Whether runs are numbered in place of their labels.
    pub is_anonymous: bool,
    /// Threads; `None` for one per core.
    pub threads: Option<usize>,
}

/// What a group came to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grouped {
    /// The sums, for a terminal.
    pub table: String,
    /// Folders that were given twice, or hold no run beside those that do.
    pub notes: Vec<String>,
    /// The folder and its digest.
    pub summary: Summary,
}

/// A folder that is to be a run.
struct Found {
    /// As the user gave it, with the name of the folder below where that has the runs.
    given: PathBuf,
    /// Whether it is a run folder.
    is_run: bool,
}

/// A run on a page.
pub(crate) struct Member {
    pub(crate) label: String,
    pub(crate) folder: PathBuf,
    /// Why it has no map, where whoever asks knows that it has none.
    pub(crate) failed: Option<Failed>,
    /// The command that does it again, where it is not that of its next stage.
    pub(crate) retry: Option<String>,
}

/// Where a page goes, and its heading.
pub(crate) struct GroupPage<'a> {
    pub(crate) out: &'a Path,
    pub(crate) title: &'a str,
    pub(crate) threads: Option<usize>,
    /// Whether to wait for another call that makes the page.
    pub(crate) wait: bool,
}

/// A page that was made.
pub(crate) struct Shown {
    /// The sums, for a terminal.
    pub(crate) table: String,
    /// The runs as they are shown.
    pub(crate) runs: Vec<GroupRun>,
    pub(crate) summary: Summary,
}

/// Shows a group of runs.
///
/// # Errors
/// [`Error`] if no folder is a run folder, there are too many, or the results cannot be written. A run that cannot be read
/// is no error: the page lists it.
pub fn group(request: &GroupRequest) -> Result<Grouped, Error> {
    refuse_run_folder(&request.out)?;
    let (found, notes) = find(request)?;
    let paths: Vec<&Path> = found.iter().map(|found| found.given.as_path()).collect();
    let labels = if request.is_anonymous { labels::numbered(paths.len()) } else { labels::of(&paths) };
    let member = |(found, label): (Found, String)| Member {
        label,
        failed: (!found.is_run).then(|| read::no_run(&found.given)),
        folder: found.given,
        retry: None,
    };
    let members: Vec<Member> = found.into_iter().zip(labels).map(member).collect();
    let title = request.title.as_deref().filter(|title| !title.trim().is_empty());
    let title = title.unwrap_or("Group of runs");
    let page = GroupPage { out: &request.out, title, threads: request.threads, wait: false };
    let shown = show(&members, &page)?;
    Ok(Grouped { table: shown.table, notes, summary: shown.summary })
}

/// Makes the page over these runs.
pub(crate) fn show(members: &[Member], page: &GroupPage<'_>) -> Result<Shown, Error> {
    refuse_run_folder(page.out)?;
    check_size(members.len())?;
    let side_px = SIDES_PX.iter().find(|(most, _)| members.len() <= *most).map_or(96, |(_, side)| *side);
    let runs: Vec<GroupRun> =
        in_pool(page.threads, || Ok(members.par_iter().map(|member| shown_run(member, side_px)).collect()))?;
    let made = espalier_report::group::group(page.title, &runs);
    let files = [
        ("group.html", made.html),
        ("group.tsv", made.tsv),
        ("group.json", made.json),
        ("dictionary.tsv", made.dictionary),
    ];
    // A page is a matter of seconds: nobody need be told that this one waits.
    let patience = if page.wait { Patience::Wait(&|| {}) } else { Patience::None };
    let mut folder = RunFolder::open_or_wait(page.out, patience)?;
    for (file, text) in &files {
        folder.write(file, text.as_bytes())?;
    }
    let highlights = files.iter().map(|(file, _)| (*file).to_owned()).collect();
    let summary = Summary { out: page.out.to_owned(), highlights, digest: folder.seal()? };
    Ok(Shown { table: made.summary, runs, summary })
}

fn shown_run(member: &Member, side_px: u32) -> GroupRun {
    let known = member.failed.clone().map(GroupOutcome::Failed);
    let mut outcome = known.unwrap_or_else(|| read::run(&member.folder, &member.label, side_px));
    if let (GroupOutcome::Failed(failed), Some(retry)) = (&mut outcome, &member.retry) {
        failed.retry = Some(retry.clone());
    }
    GroupRun { label: member.label.clone(), outcome }
}

/// Why the run that a folder was meant for has no map.
pub(crate) fn without_map(folder: &Path, label: &str) -> Failed {
    if is_run(folder) { read::unfinished(&RunFolder::to_read(folder), label) } else { read::no_run(folder) }
}

/// Results of a group must not lie among those of a run.
fn refuse_run_folder(out: &Path) -> Result<(), Error> {
    let is_in_the_way = out.join(settings::FILE).exists();
    if is_in_the_way { Err(Error::RunInTheWay { folder: out.to_owned() }) } else { Ok(()) }
}

/// A page must open.
fn check_size(n_runs: usize) -> Result<(), Error> {
    if n_runs > MOST_RUNS { Err(Error::GroupSize { n_runs, limit: MOST_RUNS }) } else { Ok(()) }
}

/// Every run folder once, in the order in which they were given, those of one folder by name; and what is to be said.
fn find(request: &GroupRequest) -> Result<(Vec<Found>, Vec<String>), Error> {
    let (mut found, mut notes, mut known) = (Vec::new(), Vec::new(), BTreeSet::new());
    for given in &request.folders {
        for (path, is_run) in runs_of(given) {
            let place = fs::canonicalize(&path).unwrap_or_else(|_| path.clone());
            if known.insert(place) {
                found.push(Found { given: path, is_run });
            } else {
                notes.push(format!("{} was given twice and is shown once", path.display()));
            }
        }
    }
    check_size(found.len())?;
    if !found.iter().any(|found| found.is_run) {
        return Err(Error::NoGroup { folders: request.folders.clone() });
    }
    Ok((found, notes))
}

/// The run folders that a path stands for, with whether they are; itself if there is none.
fn runs_of(given: &Path) -> Vec<(PathBuf, bool)> {
    if is_run(given) {
        return vec![(given.to_owned(), true)];
    }
    let entries = fs::read_dir(given).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut below: Vec<PathBuf> = entries.filter(|path| is_run(path)).collect();
    below.sort();
    if below.is_empty() {
        return vec![(given.to_owned(), false)];
    }
    below.into_iter().map(|path| (path, true)).collect()
}

/// Whether a folder is one of a run, be it unfinished.
fn is_run(path: &Path) -> bool {
    path.join("provenance").is_dir()
}
