//! One run at a time in a folder.
//!
//! **Guarantees** the system gives the lock back with the file's handle, however the process ends: a dead holder keeps
//! nothing. Whoever waits for it sees all that the holder has written. While results change, the file of the lock says so:
//! if its holder was killed meanwhile, the next one knows that there may be results which nothing vouches for yet.

use std::fs::{self, File, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

use crate::error::Error;

const LOCK_FILE: &str = ".lock";
/// How often a folder may vanish under whoever waits for it: once for each run that fails in it.
const MOST_TRIES: u32 = 1000;
/// What the file of the lock says while results change.
const CHANGING: &[u8] = b"changing\n";

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
    /// Whether its last holder ended while results changed.
    pub(crate) was_cut_short: bool,
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
                let mut said = Vec::new();
                let read = Read::by_ref(&mut file).take(CHANGING.len() as u64).read_to_end(&mut said);
                let was_cut_short = read.is_ok() && said == CHANGING;
                return Ok(Self { file, was_cut_short });
            }
        }
        Err(Error::Locked { folder: folder.to_owned() })
    }

    /// Whether a folder has the file of a lock.
    pub(crate) fn has_file(folder: &Path) -> bool {
        folder.join(LOCK_FILE).exists()
    }

    /// Says in the file whether results are about to change, before they do.
    pub(crate) fn say_changing(&self, is_changing: bool) -> io::Result<()> {
        let mut file = &self.file;
        file.set_len(0)?;
        if is_changing {
            file.seek(SeekFrom::Start(0))?;
            file.write_all(CHANGING)?;
            file.sync_data()?;
        }
        Ok(())
    }

    /// Removes the file of the lock from a folder that is about to go; the lock itself is held on.
    pub(crate) fn remove_file(folder: &Path) {
        let _ = fs::remove_file(folder.join(LOCK_FILE));
    }
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
        let was_cut_short = |says: &[bool]| {
            let lock = Lock::take(folder.path(), Patience::None).expect("a lock");
            says.iter().for_each(|&is_changing| lock.say_changing(is_changing).expect("said"));
            lock.was_cut_short
        };
        let turns: [&[bool]; 5] = [&[], &[true, false], &[true], &[], &[true, false]];
        assert_eq!(turns.map(was_cut_short), [false, false, false, true, true]);
        assert!(!was_cut_short(&[]));
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
