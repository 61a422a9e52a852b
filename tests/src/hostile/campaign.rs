//! Many mutants of one reader, watched.
//!
//! **Input** a reader, a seed number, a range of mutants. **Output** [`Tally`].
//! **Steps** of each mutant: 1. made; 2. read, with a panic caught, the time taken, and the memory at its peak over what
//! was held before, where the program counts it ([`peak_alloc`] as its allocator); 3. counted.
//! **Guarantees** a mutant that hangs ends the program, with how to make it again; one that takes long is timed thrice
//! more, as the machine may have been busy.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use peak_alloc::PeakAlloc;

use super::{Mutant, Reader};

/// No refused input takes longer.
pub const MAX_SECONDS: f64 = 2.0;
/// No refused input takes more memory than this and twice its legal size.
pub const MAX_PEAK_BYTES: usize = 64 << 20;

/// What came of many mutants.
#[derive(Default)]
pub struct Tally {
    /// How many there were.
    pub n_mutants: usize,
    /// How many were accepted.
    pub n_accepted: usize,
    /// How many were refused, by code.
    pub refused: BTreeMap<String, usize>,
    /// The mutants that did what none may, and what that was.
    pub failures: Vec<(u32, Failure)>,
    /// The longest time in seconds, and its mutant.
    pub slowest: (f64, u32),
    /// The most memory in bytes, and its mutant.
    pub largest: (usize, u32),
}

/// What no mutant may do.
#[derive(Clone, Debug, PartialEq)]
pub enum Failure {
    /// The reader panicked, with this message.
    Panic(String),
    /// It took so many seconds.
    Slow(f64),
    /// It held so many bytes at its peak.
    Large(usize),
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Panic(message) => write!(f, "panic: {message}"),
            Self::Slow(seconds) => write!(f, "{seconds:.1} s"),
            Self::Large(bytes) => write!(f, "{} MB at its peak", bytes >> 20),
        }
    }
}

/// The mutant that a seed number and an index make.
#[must_use]
pub fn mutant(reader: &Reader, seed: u64, index: u32) -> Mutant {
    reader.mutant(seed, index)
}

/// Reads a range of mutants.
#[must_use]
pub fn run(reader: &Reader, seed: u64, range: Range<u32>, watch: &Watch) -> Tally {
    let mut tally = Tally::default();
    for index in range {
        let mutant = reader.mutant(seed, index);
        let seen = watched(reader, &mutant, (index, watch));
        tally.add(index, seen);
    }
    tally
}

/// What a mutant did.
struct Seen {
    /// Accepted, a code, or the message of a panic.
    outcome: Result<Result<(), String>, String>,
    seconds: f64,
    peak_bytes: usize,
}

fn watched(reader: &Reader, mutant: &Mutant, (index, watch): (u32, &Watch)) -> Seen {
    let mut seen = once(reader, mutant, (index, watch));
    for _ in 0..3 {
        if seen.seconds > MAX_SECONDS {
            seen.seconds = once(reader, mutant, (index, watch)).seconds.min(seen.seconds);
        }
    }
    seen
}

#[allow(clippy::disallowed_methods, reason = "what is measured is time")]
fn once(reader: &Reader, mutant: &Mutant, (index, watch): (u32, &Watch)) -> Seen {
    PeakAlloc.reset_peak_usage();
    let (held, started) = (PeakAlloc.current_usage(), Instant::now());
    watch.begin(index);
    let read = catch_unwind(AssertUnwindSafe(|| reader.read(mutant, index)));
    watch.end();
    Seen {
        outcome: read.map_err(|panic| {
            let text = panic.downcast_ref::<String>().cloned();
            text.or_else(|| panic.downcast_ref::<&str>().map(|&text| text.to_owned())).unwrap_or_default()
        }),
        seconds: started.elapsed().as_secs_f64(),
        peak_bytes: PeakAlloc.peak_usage().saturating_sub(held),
    }
}

impl Tally {
    fn add(&mut self, index: u32, seen: Seen) {
        self.n_mutants += 1;
        match seen.outcome {
            Ok(Ok(())) => self.n_accepted += 1,
            Ok(Err(code)) => *self.refused.entry(code).or_default() += 1,
            Err(panic) => self.failures.push((index, Failure::Panic(panic))),
        }
        if seen.seconds > MAX_SECONDS {
            self.failures.push((index, Failure::Slow(seen.seconds)));
        }
        if seen.peak_bytes > MAX_PEAK_BYTES {
            self.failures.push((index, Failure::Large(seen.peak_bytes)));
        }
        if seen.seconds > self.slowest.0 {
            self.slowest = (seen.seconds, index);
        }
        if seen.peak_bytes > self.largest.0 {
            self.largest = (seen.peak_bytes, index);
        }
    }

    /// Adds what came of other mutants.
    pub fn extend(&mut self, other: Self) {
        self.n_mutants += other.n_mutants;
        self.n_accepted += other.n_accepted;
        other.refused.into_iter().for_each(|(code, n)| *self.refused.entry(code).or_default() += n);
        self.failures.extend(other.failures);
        self.slowest = if other.slowest.0 > self.slowest.0 { other.slowest } else { self.slowest };
        self.largest = if other.largest.0 > self.largest.0 { other.largest } else { self.largest };
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let refused: Vec<String> = self.refused.iter().map(|(code, n)| format!("{code} {n}")).collect();
        write!(
            f,
            "{} mutants, {} accepted, {} failures, slowest {:.1} ms (mutant {}), largest {} KB (mutant {}); {}",
            self.n_mutants,
            self.n_accepted,
            self.failures.len(),
            1e3 * self.slowest.0,
            self.slowest.1,
            self.largest.0 >> 10,
            self.largest.1,
            refused.join(", ")
        )
    }
}

/// Ends the program if a mutant takes longer than it may at the very most.
pub struct Watch {
    /// The mutant that is read, and since when in milliseconds; 0 when there is none.
    now: Arc<(AtomicU64, AtomicU64)>,
    started: Instant,
    is_over: Arc<AtomicBool>,
}

impl Watch {
    /// Begins to watch; `what` is how to make a mutant again, but for its index.
    #[must_use]
    #[allow(clippy::disallowed_methods, clippy::print_stderr, reason = "it watches the time, and says so")]
    pub fn over(what: String, limit: Duration) -> Self {
        let watch = Self { now: Arc::default(), started: Instant::now(), is_over: Arc::default() };
        let (now, started, is_over) = (Arc::clone(&watch.now), watch.started, Arc::clone(&watch.is_over));
        std::thread::spawn(move || {
            while !is_over.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(100));
                let since = now.1.load(Ordering::Relaxed);
                let elapsed = started.elapsed().as_millis() as u64;
                if since > 0 && elapsed.saturating_sub(since) > limit.as_millis() as u64 {
                    eprintln!("no end after {limit:?}: {what} {}", now.0.load(Ordering::Relaxed));
                    std::process::exit(1);
                }
            }
        });
        watch
    }

    fn begin(&self, index: u32) {
        self.now.0.store(index.into(), Ordering::Relaxed);
        self.now.1.store(self.started.elapsed().as_millis() as u64 + 1, Ordering::Relaxed);
    }

    fn end(&self) {
        self.now.1.store(0, Ordering::Relaxed);
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
    }
}
