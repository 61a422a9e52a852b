//! The run folder: atomic files, digests, one lock.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use atomic_write_file::AtomicWriteFile;
use sha2::{Digest, Sha256};

use crate::error::Error;
use crate::lock::{Lock, Patience};
use crate::stage::Stage;

pub(crate) const DIGEST_FILE: &str = "SHA256SUMS";

/// A run folder, held by this process alone while the value lives.
pub(crate) struct RunFolder {
    path: PathBuf,
    /// What `SHA256SUMS` says, by file.
    digests: BTreeMap<String, String>,
    /// The result files that have been read since they were last asked for.
    reads: Mutex<BTreeSet<String>>,
    /// The folders that this run made, the innermost first.
    made: Vec<PathBuf>,
    /// Whether there was no file of a lock before.
    is_lock_new: bool,
    /// None for a folder that is only read.
    lock: Option<Lock>,
    /// Whether results have changed since `SHA256SUMS` was written.
    is_changing: AtomicBool,
    /// The stage whose results, and those of later ones, change next; the first where no run says.
    at_work: Stage,
}

impl RunFolder {
    /// Opens or makes the folder and takes its lock.
    pub(crate) fn open(path: &Path) -> Result<Self, Error> {
        Self::open_or_wait(path, Patience::None)
    }

    /// As [`Self::open`]; if another run holds the folder, as patience has it.
    pub(crate) fn open_or_wait(path: &Path, patience: Patience<'_>) -> Result<Self, Error> {
        let made = path
            .ancestors()
            .take_while(|folder| !folder.as_os_str().is_empty() && !folder.exists())
            .map(Path::to_owned)
            .collect();
        let is_lock_new = !Lock::has_file(path);
        let lock = Some(Lock::take(path, patience)?);
        Ok(Self { made, is_lock_new, lock, ..Self::to_read(path) })
    }

    /// A folder to read from, without a lock: nothing is written to it.
    pub(crate) fn to_read(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            digests: read_digests(&path.join(DIGEST_FILE)),
            reads: Mutex::default(),
            made: Vec::new(),
            is_lock_new: false,
            lock: None,
            is_changing: AtomicBool::new(false),
            at_work: Stage::ALL[0],
        }
    }

    /// Removes what runs that were killed have left half-written of these files.
    pub(crate) fn remove_leftovers(&self, files: &[String]) {
        let paths: Vec<PathBuf> = files.iter().map(|file| self.path.join(file)).collect();
        let folders: BTreeSet<&Path> = paths.iter().filter_map(|path| path.parent()).collect();
        let entries = folders.into_iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten().flatten();
        for entry in entries {
            let whole = entry
                .file_name()
                .to_str()
                .and_then(name_of_leftover)
                .map(|name| entry.path().with_file_name(name));
            if whole.is_some_and(|whole| paths.contains(&whole)) {
                let _ = fs::remove_file(entry.path());
            }
        }
    }

    /// Whether this run made the folder and has put nothing into it. A result that could not be written to its end may be in
    /// place all the same: a disk that fails says so after the name is given, too.
    pub(crate) fn is_unused(&self) -> bool {
        !self.made.is_empty() && self.has_left_nothing()
    }

    fn has_left_nothing(&self) -> bool {
        self.digests.is_empty() && !self.is_changing.load(Ordering::Relaxed)
    }

    /// Removes the folders that this run made, as far as they are empty. From then on nothing may be written: another run
    /// may be in a folder of the name.
    pub(crate) fn remove(&self) {
        Lock::remove_file(&self.path);
        self.made.iter().take_while(|folder| fs::remove_dir(folder).is_ok()).for_each(drop);
    }

    /// Takes the file of the lock away again from a folder in which no run has left anything.
    pub(crate) fn leave_as_found(&self) {
        if self.is_lock_new && self.has_left_nothing() && !self.path.join("provenance").exists() {
            Lock::remove_file(&self.path);
        }
    }

    /// The stage at which the last run here was ended while it changed results: nothing vouches for some of this stage and
    /// later ones that runs have written.
    pub(crate) fn cut_short(&self) -> Option<Stage> {
        self.lock.as_ref().map_or_else(|| Lock::cut_short_in(&self.path), |lock| lock.cut_short)
    }

    /// From now on only results of this stage and later ones change.
    pub(crate) fn turn_to(&mut self, stage: Stage) {
        self.at_work = stage;
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Notes that results are about to change.
    fn begin_change(&self) -> Result<(), Error> {
        let Some(lock) = &self.lock else { return Ok(()) };
        if self.is_changing.swap(true, Ordering::Relaxed) {
            return Ok(());
        }
        lock.say_changing(self.at_work).map_err(|source| {
            // Nothing is written before it could be said.
            self.is_changing.store(false, Ordering::Relaxed);
            Error::Write { path: self.path.join(".lock"), source }
        })
    }

    /// Writes a result file, whole or not at all.
    pub(crate) fn write(&mut self, relative: &str, bytes: &[u8]) -> Result<(), Error> {
        self.begin_change()?;
        self.write_aside(relative, bytes)?;
        self.digests.insert(relative.to_owned(), hex_digest(bytes));
        Ok(())
    }

    /// The digest that the folder has for a file.
    pub(crate) fn digest(&self, relative: &str) -> Option<&String> {
        self.digests.get(relative)
    }

    /// Whether the folder has a digest for any file below a place, such as `stages/`.
    pub(crate) fn vouches_below(&self, place: &str) -> bool {
        self.digests.keys().any(|file| file.starts_with(place))
    }

    /// The files that the folder vouches for, with their lengths in bytes as they are now; none of one that is not there.
    pub(crate) fn sizes(&self) -> BTreeMap<String, Option<u64>> {
        let size = |file: &String| {
            let entry = fs::metadata(self.path.join(file)).ok().filter(fs::Metadata::is_file);
            (file.clone(), entry.map(|entry| entry.len()))
        };
        self.digests.keys().map(size).collect()
    }

    /// The digest of a file as it lies there now; none if there is none.
    pub(crate) fn digest_if_there(&self, relative: &str) -> Result<Option<String>, Error> {
        let path = self.path.join(relative);
        match file_digest(&path) {
            Ok((_, digest)) => Ok(Some(digest)),
            Err(source) if is_absent(&source) => Ok(None),
            Err(source) => Err(Error::Read { path, source }),
        }
    }

    /// The bytes of a file as it lies there now, unchecked; none if there is none.
    pub(crate) fn bytes_if_there(&self, relative: &str) -> Result<Option<Vec<u8>>, Error> {
        let path = self.path.join(relative);
        match fs::read(&path) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(source) if is_absent(&source) => Ok(None),
            Err(source) => Err(Error::Read { path, source }),
        }
    }

    /// Vouches for files that lie there already and were found to have these digests.
    pub(crate) fn adopt(&mut self, files: impl IntoIterator<Item = (String, String)>) {
        self.digests.extend(files);
    }

    /// Vouches for no other files than those that count: of what a damaged `SHA256SUMS` names, nothing stays.
    pub(crate) fn forget_unless(&mut self, counts: impl Fn(&str) -> bool) {
        self.digests.retain(|file, _| counts(file));
    }

    /// Whether the folder already vouches for just these bytes.
    pub(crate) fn vouches_for(&self, relative: &str, bytes: &[u8]) -> bool {
        self.digests.get(relative) == Some(&hex_digest(bytes))
    }

    /// Removes result files that do not follow from the others any more: first from `SHA256SUMS`, so that nothing
    /// vouches for them should this be the moment of a power cut.
    pub(crate) fn discard(&mut self, files: &[String]) -> Result<(), Error> {
        if files.is_empty() {
            return Ok(());
        }
        self.begin_change()?;
        let n_known = self.digests.len();
        self.digests.retain(|file, _| !files.contains(file));
        if self.digests.len() < n_known {
            self.write_digests()?;
        }
        for file in files {
            let path = self.path.join(file);
            match fs::remove_file(&path) {
                Err(source) if is_absent(&source) => {}
                Err(source) => return Err(Error::Write { path, source }),
                Ok(()) => {}
            }
        }
        Ok(())
    }

    /// Writes a file that is not a result (a log, a time), whole or not at all.
    pub(crate) fn write_aside(&self, relative: &str, bytes: &[u8]) -> Result<(), Error> {
        write_file(&self.path.join(relative), bytes)
    }

    /// Whether a path is that of a result file of this folder.
    pub(crate) fn has_result_at(&self, path: &Path) -> bool {
        let (Ok(folder), Ok(path)) = (fs::canonicalize(&self.path), fs::canonicalize(path)) else {
            return false;
        };
        let relative = path.strip_prefix(folder).ok().and_then(Path::to_str);
        relative.is_some_and(|relative| self.digests.contains_key(relative))
    }

    /// Checks every file that `SHA256SUMS` names against its digest.
    pub(crate) fn check_all(&self) -> Result<(), Error> {
        for (relative, expected) in &self.digests {
            let path = self.path.join(relative);
            let (_, found) =
                file_digest(&path).map_err(|source| Error::Read { path: path.clone(), source })?;
            if found != *expected {
                return Err(Error::Altered { path });
            }
        }
        Ok(())
    }

    /// The bytes of a result file, checked against its digest if the folder has one.
    pub(crate) fn read(&self, relative: &str) -> Result<Vec<u8>, Error> {
        let path = self.path.join(relative);
        let bytes = fs::read(&path).map_err(|source| Error::Read { path: path.clone(), source })?;
        self.reads.lock().unwrap_or_else(PoisonError::into_inner).insert(relative.to_owned());
        self.check(relative, &bytes).map(|()| bytes)
    }

    /// The result files that have been read since the last call.
    pub(crate) fn take_reads(&self) -> BTreeSet<String> {
        std::mem::take(&mut self.reads.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// One digest over the lines of `SHA256SUMS` for the files that count.
    pub(crate) fn digest_of(&self, counts: impl Fn(&str) -> bool) -> String {
        let counted = self.digests.iter().filter(|(file, _)| counts(file));
        let text: String = counted.map(|(file, digest)| format!("{digest}  {file}\n")).collect();
        hex_digest(text.as_bytes())
    }

    /// The text of a result file, checked; none if there is no such file.
    pub(crate) fn text_if_there(&self, relative: &str) -> Result<Option<String>, Error> {
        if !self.path.join(relative).exists() {
            return Ok(None);
        }
        self.read(relative).map(|bytes| Some(String::from_utf8_lossy(&bytes).into_owned()))
    }

    /// The bytes of a result file, checked; none if there is no such file.
    pub(crate) fn checked_if_there(&self, relative: &str) -> Result<Option<Vec<u8>>, Error> {
        if self.path.join(relative).exists() { self.read(relative).map(Some) } else { Ok(None) }
    }

    /// Checks bytes against the digest that the folder has for them, if any.
    pub(crate) fn check(&self, relative: &str, bytes: &[u8]) -> Result<(), Error> {
        match self.digests.get(relative) {
            Some(digest) if *digest != hex_digest(bytes) => {
                Err(Error::Altered { path: self.path.join(relative) })
            }
            _ => Ok(()),
        }
    }

    /// Writes `SHA256SUMS` (the format of `sha256sum -c`) and gives its own digest.
    pub(crate) fn seal(&self) -> Result<String, Error> {
        let digest = self.write_digests()?;
        if let (Some(lock), true) = (&self.lock, self.is_changing.swap(false, Ordering::Relaxed)) {
            lock.say_changed().map_err(|source| Error::Write { path: self.path.join(".lock"), source })?;
        }
        Ok(digest)
    }

    fn write_digests(&self) -> Result<String, Error> {
        let text: String = self.digests.iter().map(|(file, digest)| format!("{digest}  {file}\n")).collect();
        self.write_aside(DIGEST_FILE, text.as_bytes())?;
        Ok(hex_digest(text.as_bytes()))
    }
}

/// Writes a file, whole or not at all, and the folder that it lies in.
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    if let Some(parent) = path.parent().filter(|parent| !parent.as_os_str().is_empty()) {
        fs::create_dir_all(parent).map_err(|source| Error::Create { path: parent.to_owned(), source })?;
    }
    let write = |source| Error::Write { path: path.to_owned(), source };
    let mut file =
        AtomicWriteFile::open(path).map_err(|source| Error::Create { path: path.to_owned(), source })?;
    file.write_all(bytes).map_err(write)?;
    file.commit().map_err(write)
}

/// The name that a file would have got, from that under which `atomic_write_file` writes it: `.NAME.XXXXXX`.
fn name_of_leftover(name: &str) -> Option<&str> {
    let (name, random) = name.strip_prefix('.')?.rsplit_once('.')?;
    (random.len() == 6 && random.bytes().all(|byte| byte.is_ascii_alphanumeric())).then_some(name)
}

pub(crate) fn is_absent(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory)
}

/// The digests of an earlier run; none if the file is missing or not ours, since then nothing can be checked.
fn read_digests(path: &Path) -> BTreeMap<String, String> {
    let text = fs::read_to_string(path).unwrap_or_default();
    text.lines()
        .filter_map(|line| line.split_once("  "))
        .map(|(digest, file)| (file.to_owned(), digest.to_owned()))
        .collect()
}

/// The SHA-256 of some bytes, in hexadecimal digits.
pub(crate) fn hex_digest(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The number of bytes and the SHA-256 of a file, read in pieces.
pub(crate) fn file_digest(path: &Path) -> io::Result<(u64, String)> {
    let mut file = File::open(path)?;
    let mut hasher = Sha256::new();
    let mut piece = vec![0; 1 << 16];
    let mut n_bytes = 0;
    loop {
        let n_read = file.read(&mut piece)?;
        if n_read == 0 {
            let digits = hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
            return Ok((n_bytes, digits));
        }
        hasher.update(&piece[..n_read]);
        n_bytes += n_read as u64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As with an error of the disk after a result has got its name: its run knows only that it could not be written.
    #[test]
    fn a_result_that_may_be_there_keeps_the_folder_known_as_ours() {
        let parent = tempfile::tempdir().expect("temporary folder");
        let path = parent.path().join("run");
        let mut folder = RunFolder::open(&path).expect("a folder");
        assert!(folder.is_unused());
        folder.turn_to(Stage::Volume);
        fs::write(path.join("stages"), "in the way").expect("a file");
        assert!(folder.write("stages/01-volume/mask.nii.gz", b"x").is_err());
        assert!(!folder.is_unused());
        folder.leave_as_found();
        drop(folder);
        assert_eq!(RunFolder::to_read(&path).cut_short(), Some(Stage::Volume));
        assert_eq!(RunFolder::open(&path).expect("a folder").cut_short(), Some(Stage::Volume));
    }
}
