//! A thousand mutants of every reader: none panics, hangs or takes more memory than it may. `scripts/mutants` is the same
//! for a million.
#![allow(clippy::panic, clippy::print_stdout, reason = "this is how a test speaks")]

use std::time::Duration;

use espalier_tests::hostile::campaign::{Watch, run};
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
    // Panics are counted; their messages stand in the tally.
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let tallies: Vec<_> = readers.iter().map(|reader| (reader.name, tally(reader))).collect();
    std::panic::set_hook(hook);
    let mut failed = Vec::new();
    for (name, tally) in &tallies {
        println!("{name}: {tally}");
        let again =
            |(index, what): &(u32, String)| format!("scripts/mutants --again {name} {SEED} {index}: {what}");
        failed.extend(tally.failures.iter().filter(|(_, what)| !what.ends_with(" s")).map(again));
        let n_refused = tally.n_mutants - tally.n_accepted;
        assert!(tally.n_accepted > 0 && n_refused > 0, "{name}: all or none were accepted");
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

fn seeds_are_accepted(reader: &Reader) {
    assert!(reader.n_seeds() > 0, "{} has no seed", reader.name);
    let Ok(folder) = tempfile::tempdir() else { panic!("no folder for temporary files") };
    for (index, seed) in reader.unchanged().iter().enumerate() {
        let read = reader.read(seed, folder.path(), 0);
        assert_eq!(read, Ok(()), "seed {index} of {}", reader.name);
    }
}

fn tally(reader: &Reader) -> espalier_tests::hostile::campaign::Tally {
    let watch = Watch::over(format!("scripts/mutants --again {} {SEED}", reader.name), HANG);
    run(reader, SEED, 0..N_MUTANTS, &watch)
}
