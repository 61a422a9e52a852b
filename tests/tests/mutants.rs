//! A thousand mutants of every reader: none panics, hangs or takes more memory than it may. `scripts/mutants` is the same
//! for a million.
#![allow(clippy::print_stdout, reason = "this is how a test speaks")]

use std::time::Duration;

use espalier_tests::hostile::campaign::{Failure, Tally, Watch, run};
use espalier_tests::hostile::{Reader, readers};
use peak_alloc::PeakAlloc;

/// Counts what is held.
#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

const N_MUTANTS: u32 = 1000;
const SEED: u64 = 1;
/// What never ends, however busy the machine.
const HANG: Duration = Duration::from_secs(60);

/// One test, as memory is counted for the whole program.
#[test]
fn a_thousand_mutants_of_every_reader() {
    let readers = readers();
    readers.iter().for_each(seeds_are_accepted);
    nothing_is_left_of_another(&readers);
    // Panics are counted; their messages stand in the tally.
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let tallies: Vec<_> = readers.iter().map(|reader| (reader.name, tally(reader))).collect();
    std::panic::set_hook(hook);
    let mut failed = Vec::new();
    for (name, tally) in &tallies {
        println!("{name}: {tally}");
        let again =
            |(index, what): &(u32, Failure)| format!("scripts/mutants --again {name} {SEED} {index}: {what}");
        // How long one takes on a busy machine is for the script to say.
        let (slow, wrong): (Vec<_>, Vec<_>) =
            tally.failures.iter().partition(|(_, what)| matches!(what, Failure::Slow(_)));
        slow.into_iter().map(again).for_each(|line| println!("{line}"));
        failed.extend(wrong.into_iter().map(again));
        let n_refused = tally.n_mutants - tally.n_accepted;
        assert!(tally.n_accepted > 0 && n_refused > 0, "{name}: all or none were accepted");
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

fn seeds_are_accepted(reader: &Reader) {
    assert!(reader.n_seeds() > 0, "{} has no seed", reader.name);
    for (index, seed) in reader.unchanged().iter().enumerate() {
        let read = reader.read(seed, 0);
        assert_eq!(read, Ok(()), "seed {index} of {}", reader.name);
    }
}

/// A header whose data were there for the mutant before finds none.
fn nothing_is_left_of_another(readers: &[Reader]) {
    let mut n_tried = 0;
    for reader in readers.iter().filter(|reader| ["nhdr", "mhd", "nifti-pair"].contains(&reader.name)) {
        for mut mutant in reader.unchanged() {
            assert_eq!(reader.read(&mutant, 0), Ok(()), "{}", reader.name);
            mutant.files.truncate(1);
            assert!(reader.read(&mutant, 0).is_err(), "{}", reader.name);
            n_tried += 1;
        }
    }
    assert!(n_tried >= 3, "only {n_tried} headers with data beside them");
}

fn tally(reader: &Reader) -> Tally {
    let watch = Watch::over(format!("scripts/mutants --again {} {SEED}", reader.name), HANG);
    run(reader, SEED, 0..N_MUTANTS, &watch)
}
