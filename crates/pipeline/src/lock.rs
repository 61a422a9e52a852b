//! One run at a time in a folder.
//!
//! **Guarantees** the system gives the lock back with the file's handle, however the process ends: a dead holder keeps
//! nothing. Whoever waits for it sees all that the holder has written. While results change, the file of the lock says so,
//! and of which stage: if its holder was killed meanwhile, the next one knows that there may be results of that stage and
//! later ones which nothing vouches for.

use std::fs::{self, File, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

use crate::error::Error;
use crate::stage::Stage;

const LOCK_FILE: &str = ".lock";
/// How often a folder may vanish under whoever waits for it: once for each run that fails in it.
const MOST_TRIES: u32 = 1000;
/// What the file of the lock says while results change, before the name of the stage and the end of the line.
const CHANGING: &str = "changing";
/// The most that is read of it, in bytes.
const MAX_SAID: u64 = 64;

/// What to do where another run holds the folder.
#[derive(Clone, Copy)]
pub(crate) enum Patience<'a> {
    /// Stop with [`Error::Locked`].
    None,
    /// Say so, and wait for it.
    Wait(&'a dyn Fn()),
}

/// The right to write to a folder; given back when it is dropped.
pub(crate) struct Lock {
    file: File,
    /// The stage whose results changed when its last holder ended, if some did.
    pub(crate) cut_short: Option<Stage>,
}

impl Lock {
    /// Takes the lock of a folder, which is made if it is not there.
    pub(crate) fn take(folder: &Path, patience: Patience<'_>) -> Result<Self, Error> {
        let create = |source| Error::Create { path: folder.to_owned(), source };
        for tries_left in (0..MOST_TRIES).rev() {
            fs::create_dir_all(folder).map_err(create)?;
            let path = folder.join(LOCK_FILE);
            // What the last holder has said stays to be read.
            let mut options = File::options();
            let mut file = match options.read(true).write(true).create(true).truncate(false).open(&path) {
                // The holder takes the folder away with it at just this moment.
                Err(source) if source.kind() == io::ErrorKind::NotFound && tries_left > 0 => continue,
                created => created.map_err(create)?,
            };
            match (file.try_lock(), patience) {
                (Ok(()), _) => {}
                (Err(TryLockError::WouldBlock), Patience::None) => {
                    return Err(Error::Locked { folder: folder.to_owned() });
                }
                (Err(TryLockError::WouldBlock), Patience::Wait(say_so)) => {
                    say_so();
                    file.lock().map_err(create)?;
                }
                // A file system without locks (some network mounts) still serves a single run.
                (Err(TryLockError::Error(source)), _) if source.kind() == io::ErrorKind::Unsupported => {}
                (Err(TryLockError::Error(source)), _) => return Err(create(source)),
            }
            // A run that fails takes the folder that it made away with it; the lock of a file that is gone locks nothing.
            if is_at(&file, &path) {
                let cut_short = stage_said_in(&mut file);
                return Ok(Self { file, cut_short });
            }
        }
        Err(Error::Locked { folder: folder.to_owned() })
    }

    /// Whether a folder has the file of a lock.
    pub(crate) fn has_file(folder: &Path) -> bool {
        folder.join(LOCK_FILE).exists()
    }

    /// The stage whose results changed when the last holder of a folder ended; or change just now.
    pub(crate) fn cut_short_in(folder: &Path) -> Option<Stage> {
        stage_said_in(&mut File::open(folder.join(LOCK_FILE)).ok()?)
    }

    /// Says in the file that results of a stage and later ones are about to change, before they do. What was said there
    /// before is written over in one go: at no moment is nothing said.
    pub(crate) fn say_changing(&self, stage: Stage) -> io::Result<()> {
        let mut file = &self.file;
        let said = format!("{CHANGING} {stage}\n");
        file.seek(SeekFrom::Start(0))?;
        file.write_all(said.as_bytes())?;
        file.set_len(said.len() as u64)?;
        file.sync_data()
    }

    /// Says that results belong together again.
    pub(crate) fn say_changed(&self) -> io::Result<()> {
        self.file.set_len(0)
    }

    /// Removes the file of the lock from a folder that is about to go; the lock itself is held on.
    pub(crate) fn remove_file(folder: &Path) {
        let _ = fs::remove_file(folder.join(LOCK_FILE));
    }
}

/// The stage that the file of a lock names; the first of all where it says only that results change.
fn stage_said_in(file: &mut File) -> Option<Stage> {
    let mut said = Vec::new();
    file.take(MAX_SAID).read_to_end(&mut said).ok()?;
    let said = String::from_utf8_lossy(&said);
    let (line, _) = said.split_once('\n')?;
    let name = line.strip_prefix(CHANGING)?;
    Some(Stage::from_name(name.trim()).unwrap_or(Stage::ALL[0]))
}

/// Whether an open file is still the one at a path.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |metadata: fs::Metadata| (metadata.dev(), metadata.ino());
    match (file.metadata(), fs::metadata(path)) {
        (Ok(held), Ok(there)) => identity(held) == identity(there),
        _ => false,
    }
}

/// Whether an open file is still the one at a path: where an open file cannot be removed, always.
#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

#[cfg(test)]
#[allow(clippy::expect_used, reason = "a test says what it expects")]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn the_second_is_refused_and_comes_in_after_the_first() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let first = Lock::take(folder.path(), Patience::None).expect("a lock");
        let second = Lock::take(folder.path(), Patience::None);
        assert!(matches!(second, Err(Error::Locked { .. })));
        drop(first);
        assert!(Lock::take(folder.path(), Patience::None).is_ok());
    }

    #[test]
    fn the_next_holder_knows_how_the_last_one_ended() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let cut_short = |says: &[Option<Stage>]| {
            let peeked = Lock::cut_short_in(folder.path());
            let lock = Lock::take(folder.path(), Patience::None).expect("a lock");
            for stage in says {
                stage.map_or_else(|| lock.say_changed(), |stage| lock.say_changing(stage)).expect("said");
            }
            assert_eq!(peeked, lock.cut_short);
            lock.cut_short
        };
        let (skeleton, tree) = (Some(Stage::Skeleton), Some(Stage::Tree));
        let turns: [&[Option<Stage>]; 7] =
            [&[], &[tree, None], &[skeleton], &[], &[tree], &[tree, None], &[]];
        assert_eq!(turns.map(cut_short), [None, None, None, skeleton, skeleton, tree, None]);
    }

    #[test]
    fn a_lock_that_names_no_stage_speaks_of_all() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let cases = [
            ("", None),
            ("chang", None),
            ("changing", None),
            ("changing\n", Some(Stage::Phantom)),
            ("changing a stage to come\n", Some(Stage::Phantom)),
            ("changing tree\nleton\n", Some(Stage::Tree)),
        ];
        for (said, stage) in cases {
            fs::write(folder.path().join(LOCK_FILE), said).expect("a file");
            assert_eq!(Lock::cut_short_in(folder.path()), stage, "{said}");
        }
    }

    #[test]
    fn those_who_wait_come_in_one_at_a_time() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let (inside, waited) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let say_so = || _ = waited.fetch_add(1, Ordering::SeqCst);
        let held = Lock::take(folder.path(), Patience::None).expect("a lock");
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    let say_so = || say_so();
                    let lock = Lock::take(folder.path(), Patience::Wait(&say_so)).expect("a lock");
                    assert_eq!(inside.fetch_add(1, Ordering::SeqCst), 0, "two at once");
                    std::thread::sleep(std::time::Duration::from_millis(5));
                    inside.fetch_sub(1, Ordering::SeqCst);
                    drop(lock);
                });
            }
            while waited.load(Ordering::SeqCst) < 4 {
                std::thread::yield_now();
            }
            drop(held);
        });
    }

    #[test]
    fn a_lock_of_a_removed_folder_is_taken_anew() {
        let parent = tempfile::tempdir().expect("temporary folder");
        let folder = parent.path().join("run");
        let held = Lock::take(&folder, Patience::None).expect("a lock");
        std::thread::scope(|scope| {
            let (sender, receiver) = std::sync::mpsc::channel();
            let folder = &folder;
            let waiting = scope.spawn(move || {
                let say_so = || sender.send(()).expect("a listener");
                Lock::take(folder, Patience::Wait(&say_so)).map(|_| folder.join(LOCK_FILE).exists())
            });
            receiver.recv().expect("a waiting thread");
            fs::remove_dir_all(folder).expect("a folder");
            drop(held);
            assert!(waiting.join().expect("a thread").expect("a lock"), "the folder is there again");
        });
    }
}
