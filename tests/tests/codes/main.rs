//! The catalogue of codes against the sources: nothing that can be printed is without an entry, no entry is without a
//! source, exit codes are those of the errors, and every error is raised by a test.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

mod errors;
mod sources;

use std::collections::{BTreeMap, BTreeSet};

use espalier_pipeline::catalogue;
use sources::Sources;

/// Errors that no test raises: what they tell of would have to be broken first.
const UNRAISED: &[(&str, &str)] = &[
    ("E-VOLUME-NO-MEMORY", "the machine of the tests would have to be out of memory"),
    ("E-RUN-THREADS", "the account of the tests would have to be out of threads"),
    ("E-DICOM-FILES", "a folder of 100,001 files takes longer than all other tests of its kind"),
    ("E-VOLUME-RESAMPLE", "a grid that could be read has none at a legal spacing that could not be written"),
    ("E-PHANTOM-NO-PLACE", "no seed is known whose neuron runs out of room"),
    ("E-JUXTAPOSE-TREE", "both trees are legal, and no pair is known that coincides once it is moved"),
];

/// Codes that are given elsewhere than in `Diagnose`, or whose class is that of another error, with their exit codes.
const ELSEWHERE: &[(&str, &[u8])] =
    &[("E-USAGE", &[2]), ("E-GROUP-UNFINISHED", &[]), ("E-COHORT-FAILED", &[1, 2, 3, 5, 6, 8, 73, 74, 75])];

#[test]
fn every_code_has_an_entry_and_every_entry_a_source() {
    let sources = Sources::read();
    let given: BTreeSet<&str> = sources.given().collect();
    let entries = catalogue();
    let explained: BTreeSet<&str> = entries.iter().map(|entry| entry.code.as_str()).collect();
    let unexplained: Vec<_> = given.difference(&explained).collect();
    assert!(unexplained.is_empty(), "without an entry in crates/pipeline/src/explain: {unexplained:?}");
    let unknown: Vec<_> = explained.difference(&given).collect();
    assert!(unknown.is_empty(), "explained, but no source gives them: {unknown:?}");
    assert!(given.len() > 200, "{}", given.len());
}

#[test]
fn exit_codes_are_those_of_the_errors() {
    let found = errors::exit_codes(&Sources::read());
    let mut wrong = Vec::new();
    for entry in catalogue().iter().filter(|entry| entry.code.starts_with("E-")) {
        let elsewhere = ELSEWHERE.iter().find(|(code, _)| *code == entry.code).map(|(_, exits)| *exits);
        let mut exits: BTreeSet<u8> = elsewhere.unwrap_or_default().iter().copied().collect();
        exits.extend(found.get(&entry.code).into_iter().flatten());
        let stated: BTreeSet<u8> = entry.exit_codes().iter().copied().collect();
        if stated != exits {
            wrong.push(format!("{}: the entry says {stated:?}, the errors {exits:?}", entry.code));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// A test raises an error if its source has the code in a string, or the variant of the error by name.
#[test]
fn every_error_is_raised_by_a_test() {
    let sources = Sources::read();
    let variants = errors::variants(&sources);
    let mut raised_by: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for entry in catalogue() {
        let by_name = variants.get(&entry.code).into_iter().flatten();
        let mut tests = sources.tests_with_code(&entry.code);
        tests.extend(by_name.flat_map(|variant| sources.tests_with_variant(variant)));
        raised_by.insert(entry.code.clone(), tests);
    }
    let is_exempt = |code: &str, exits: &[u8]| {
        // An error of class internal is a bug of ours: no input raises it.
        exits == [1] || UNRAISED.iter().any(|(unraised, _)| *unraised == code)
    };
    let unraised: Vec<String> = catalogue()
        .into_iter()
        .filter(|entry| entry.code.starts_with("E-"))
        .filter(|entry| raised_by[&entry.code].is_empty() && !is_exempt(&entry.code, entry.exit_codes()))
        .map(|entry| entry.code)
        .collect();
    assert!(unraised.is_empty(), "raised by no test: {unraised:#?}");
    let idle: Vec<_> = UNRAISED.iter().filter(|(code, _)| !raised_by[*code].is_empty()).collect();
    assert!(idle.is_empty(), "raised after all: {idle:?}");
}
