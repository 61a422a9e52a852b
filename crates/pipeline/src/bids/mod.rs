//! A BIDS data set as a cohort: `espalier bids IN OUT participant|group`.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 1 | `find`, `name`, `participants` | participants, sessions, and the volumes below them |
//! | 2 | this file | which of them are meant, and where the results of each go |
//! | 3 | `description` | what the data set says of itself, and what ours says |
//! | 4 | [`cohort`](crate::cohort) | doing them, and the page |
//!
//! **Input** a data set: `sub-*/[ses-*/]…/*.nii[.gz]`. **Output** a [`Cohort`]: a run folder a volume,
//! `sub-01/[ses-A/]anat/sub-01_…_mask/`; beside them `dataset_description.json`, `.bidsignore`, `group/`, `failures.tsv`.
//! **Guarantees** which volumes are meant depends on the data set and the filters alone, not on the participants that are
//! asked for, so that jobs for one participant each agree. Volumes of several kinds are never chosen between silently.
//! **Source** the BIDS-Apps convention [Gorgolewski2017]: positional arguments, labels without `sub-` and `ses-`.

mod description;
mod find;
mod name;
mod participants;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::cohort::{Absent, Cohort, Retry, Sample, Word, written};
use crate::config::{Loaded, Override};
use crate::error::Error;
use crate::run;
use find::{Scan, Visit};

/// How many of the labels that there are a message names.
const MOST_LABELS: usize = 50;

/// A BIDS data set as it is asked for.
#[derive(Clone, Debug, Default)]
pub struct BidsRequest {
    /// The data set.
    pub input: PathBuf,
    /// Where the results go: a data set of derivatives.
    pub out: PathBuf,
    /// The participants, with or without `sub-`; all if none is named.
    pub participants: Vec<String>,
    /// The sessions, with or without `ses-`; all if none is named.
    pub sessions: Vec<String>,
    /// What the names of the volumes end with, such as `mask`; that of all volumes if they have but one.
    pub suffix: Option<String>,
    /// Entities that the volumes must have, such as `desc` = `airway`; an empty value for one that they must not have.
    pub filters: Vec<(String, String)>,
    /// Whether the data set is taken as it is.
    pub skip_validation: bool,
    /// The config that all are run with.
    pub config: Option<PathBuf>,
    /// What the command line changes.
    pub overrides: Vec<Override>,
    /// Other options of the command line, as the commands repeat them that do a participant alone.
    pub options: Vec<Word>,
    /// What `$ESPALIER_DATA` stands for.
    pub data_dir: Option<PathBuf>,
}

/// The scans of a data set; nothing is done yet, but what the results say of themselves is written.
///
/// # Errors
/// [`Error`] if the data set does not describe itself, no volume is meant, volumes of several kinds are, a participant is
/// not there, or the results would lie in a data set of another program.
pub fn bids(request: &BidsRequest) -> Result<Cohort, Error> {
    if !request.skip_validation {
        description::check(&request.input)?;
    }
    let visits = find::visits(&request.input)?;
    let mut found = find::scans(&visits)?;
    found.iter_mut().for_each(|(_, scans)| scans.retain(|scan| fits(request, scan)));
    let suffix = suffix(request, &found)?;
    for (visit, scans) in &mut found {
        scans.retain(|scan| scan.name.suffix == suffix);
        check(request, visit, scans)?;
    }
    let listed = match participants::listed(&request.input) {
        Err(Error::BidsDataset { .. }) if request.skip_validation => BTreeSet::new(),
        listed => listed?,
    };
    check_labels(request, &visits, &listed)?;
    let is_whole = request.participants.is_empty() && request.sessions.is_empty();
    let mut cohort = Cohort::new(request.out.clone(), is_whole);
    for (visit, scans) in found.iter().filter(|(visit, _)| is_asked_for(request, visit)) {
        for scan in scans {
            cohort.samples.push(sample(request, visit, scan)?);
        }
        if scans.is_empty() {
            cohort.absent.push(absent(
                visit.relative(),
                format!("no volume fits: suffix {suffix}{}", filters(request)),
            ));
        }
    }
    let there: BTreeSet<&str> = visits.iter().map(|visit| visit.participant.as_str()).collect();
    let is_meant = |label: &String| is_chosen(&request.participants, "sub", label);
    for label in listed.iter().filter(|label| is_meant(label) && !there.contains(label.as_str())) {
        cohort.absent.push(absent(
            format!("sub-{label}"),
            "in participants.tsv, but there is no such folder".to_owned(),
        ));
    }
    if cohort.samples.is_empty() {
        return Err(Error::NoBidsScan { folder: request.input.clone(), suffix, filters: filters(request) });
    }
    description::write(&request.input, &request.out)?;
    Ok(cohort)
}

fn absent(id: String, reason: String) -> Absent {
    Absent { id, code: "E-BIDS-NO-SCAN", reason }
}

/// Whether a volume has the entities asked for.
fn fits(request: &BidsRequest, scan: &Scan) -> bool {
    request.filters.iter().all(|(key, value)| {
        let found = match key.as_str() {
            "datatype" => scan.between.iter().next().and_then(|folder| folder.to_str()),
            key => scan.name.entity(key),
        };
        found.unwrap_or_default() == value
    })
}

/// The filters, as they are told.
fn filters(request: &BidsRequest) -> String {
    let told = request.filters.iter().map(|(key, value)| match value.as_str() {
        "" => format!(", without {key}"),
        value => format!(", {key}-{value}"),
    });
    told.collect()
}

/// The suffix asked for, or that of all volumes.
fn suffix(request: &BidsRequest, found: &[(&Visit, Vec<Scan>)]) -> Result<String, Error> {
    if let Some(suffix) = &request.suffix {
        return Ok(suffix.trim_start_matches('_').to_owned());
    }
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for scan in found.iter().flat_map(|(_, scans)| scans) {
        *counts.entry(&scan.name.suffix).or_default() += 1;
    }
    let mut suffixes = counts.keys();
    match (suffixes.next(), suffixes.next()) {
        (Some(only), None) => Ok((*only).to_owned()),
        (None, _) => Err(Error::NoBidsScan {
            folder: request.input.clone(),
            suffix: "any".to_owned(),
            filters: filters(request),
        }),
        _ => {
            let told = counts.iter().map(|(suffix, n)| format!("{suffix} ({n})"));
            Err(Error::BidsSuffix { suffixes: told.collect::<Vec<_>>().join(", ") })
        }
    }
}

/// Volumes must be called as their folders are, and no two have one run folder.
fn check(request: &BidsRequest, visit: &Visit, scans: &[Scan]) -> Result<(), Error> {
    let refused = |scan: &Scan, problem: String| Error::BidsDataset { path: scan.path.clone(), problem };
    for (idx, scan) in scans.iter().enumerate() {
        let is_own = scan.name.entity("sub") == Some(&visit.participant)
            && visit.session.as_deref().is_none_or(|session| scan.name.entity("ses") == Some(session));
        if !is_own && !request.skip_validation {
            return Err(refused(scan, format!("its name is not that of {}", visit.relative())));
        }
        let place = |scan: &Scan| (scan.between.clone(), scan.name.stem.clone());
        if idx > 0 && place(&scans[idx - 1]) == place(scan) {
            let twin = scans[idx - 1].path.display().to_string();
            return Err(refused(scan, format!("it has the name of {twin}: which of them is meant?")));
        }
    }
    Ok(())
}

/// Participants and sessions that are asked for must be there.
fn check_labels(request: &BidsRequest, visits: &[Visit], listed: &BTreeSet<String>) -> Result<(), Error> {
    let mut participants = listed.clone();
    participants.extend(visits.iter().map(|visit| visit.participant.clone()));
    let sessions: BTreeSet<String> = visits.iter().filter_map(|visit| visit.session.clone()).collect();
    for (what, key, asked, known) in [
        ("participant", "sub", &request.participants, participants),
        ("session", "ses", &request.sessions, sessions),
    ] {
        for label in asked.iter().map(|label| plain(label, key)) {
            if !known.contains(label) {
                let n_more = known.len().saturating_sub(MOST_LABELS);
                let more = if n_more > 0 { format!(" and {n_more} more") } else { String::new() };
                let there = known.into_iter().take(MOST_LABELS).collect::<Vec<_>>().join(", ") + &more;
                return Err(Error::NoBidsLabel { what, label: label.to_owned(), there });
            }
        }
    }
    Ok(())
}

/// A label without its key.
fn plain<'a>(label: &'a str, key: &str) -> &'a str {
    name::label(label, key).unwrap_or(label)
}

fn is_chosen(asked: &[String], key: &str, label: &str) -> bool {
    asked.is_empty() || asked.iter().any(|asked| plain(asked, key) == label)
}

fn is_asked_for(request: &BidsRequest, visit: &Visit) -> bool {
    let is_session = |session: &String| is_chosen(&request.sessions, "ses", session);
    is_chosen(&request.participants, "sub", &visit.participant)
        && visit.session.as_ref().map_or(request.sessions.is_empty(), is_session)
}

fn sample(request: &BidsRequest, visit: &Visit, scan: &Scan) -> Result<Sample, Error> {
    let path = std::path::absolute(&scan.path).unwrap_or_else(|_| scan.path.clone());
    let loaded = match &request.config {
        None => Loaded::read(&path, &request.overrides)?,
        Some(config) => {
            let value = toml::Value::from(path.to_string_lossy().into_owned()).to_string();
            let mut overrides = vec![Override { key: "input.path".to_owned(), value }];
            overrides.extend(request.overrides.iter().cloned());
            Loaded::read_config(config, &overrides)?
        }
    };
    run::source_of(&loaded, request.data_dir.as_deref())?;
    let place = Path::new(&visit.relative()).join(&scan.between).join(&scan.name.stem);
    // Where the data set lies says nothing of what is in it.
    let mut written = written(&loaded.config, &request.input, &[&request.overrides]);
    written.insert("input.path", place.to_string_lossy().into_owned());
    Ok(Sample {
        id: if request.skip_validation {
            place.to_string_lossy().into_owned()
        } else {
            scan.name.stem.clone()
        },
        out: request.out.join(&place),
        loaded,
        config_file: request.config.clone(),
        written,
        retry: Retry::of(|path| words(request, visit, path)),
    })
}

/// The command that does a participant, or its session, alone.
fn words(request: &BidsRequest, visit: &Visit, path: &dyn Fn(&Path) -> String) -> Vec<String> {
    let word = |file: &Path| Retry::word(&path(file));
    let mut words = vec!["espalier bids".to_owned(), word(&request.input), word(&request.out)];
    words.push(format!("participant --participant-label {}", visit.participant));
    words.extend(visit.session.iter().map(|session| format!("--session-label {session}")));
    words.extend(request.suffix.iter().map(|suffix| format!("--suffix {}", Retry::word(suffix))));
    let filter =
        |(key, value): &(String, String)| format!("--filter {}", Retry::word(&format!("{key}={value}")));
    words.extend(request.filters.iter().map(filter));
    words.extend(request.skip_validation.then(|| "--skip-bids-validation".to_owned()));
    words.extend(request.config.iter().map(|config| format!("--config {}", word(config))));
    words.extend(Retry::settings(&request.overrides, path));
    words.extend(Retry::options(&request.options, path));
    words
}
