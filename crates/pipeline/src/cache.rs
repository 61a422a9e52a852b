//! A store of results that many run folders share: a run that agrees with an earlier one up to a stage copies what that one
//! made.
//!
//! **Input** what a stage's results would be made from. **Output** its files, if they are in the store.
//! **Steps** 1. The record under the key: its own digest, and that it was made from just the same. 2. Each file by the digest
//! that the record has for it; bytes that are others are removed and count as absent. 3. What was made is stored by its
//! content, the record last. 4. At the end of a run the records that were used least lately go, with their files, until
//! the store is within its limit.
//! **Guarantees** files are copied, never linked: damage to the store reaches no result, nor the other way round. What is
//! taken has the digests of the record. Files are renamed into place, so a reader sees all of one or nothing; who stores
//! shares a lock that who makes room holds alone. The folder may be removed at any time.
//! **Differs from the source** of constructive traces ([`crate::record`]): one value a key, since equal keys have equal results.
//!
//! ```text
//! DIR/espalier-cache-1/
//! ├── CACHEDIR.TAG             so that backups pass it over
//! ├── keys/embed-<key>         the digest of the record, and the record
//! ├── objects/<ab>/<sha256>    the bytes of a file
//! └── .lock
//! ```
//!
//! Why not in the user's cache folder by default? What is stored is a patient's anatomy, and home folders of clusters are
//! small: who wants the store says where.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::clock;
use crate::error::Error;
use crate::folder::{file_digest, hex_digest, write_file};
use crate::record::{MadeFrom, Record};
use crate::stage::Stage;

/// The folder of this version of the store.
const FOLDER: &str = "espalier-cache-1";
/// <https://bford.info/cachedir/>.
const TAG: &str = "Signature: 8a477f597d28d172789f06886806bc55\n\
                   # Results of espalier that runs share. The folder may be removed at any time.\n";
/// The largest record that is read: one has a line for each setting and file.
const MAX_RECORD_BYTES: u64 = 1 << 20;

/// A store of results and how large it may be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cache {
    /// The folder that it lies in; made if it is not there.
    pub folder: PathBuf,
    /// How large it may be after a run, in bytes.
    pub max_bytes: u64,
}

/// The results of a stage, from the store.
pub(crate) struct Taken {
    /// Its files but for the record, relative to the run folder.
    pub(crate) files: Vec<(String, Vec<u8>)>,
    /// What the stage had to say.
    pub(crate) line: String,
}

impl Cache {
    /// Whether the store seems to have a stage's results; no file is checked.
    pub(crate) fn has(&self, stage: Stage, made_from: &MadeFrom) -> bool {
        let record = self.record(stage, made_from);
        record.is_some_and(|record| record.files().values().all(|digest| self.object(digest).is_file()))
    }

    /// A stage's results, each file checked. None if there are none, or a file is missing, was altered, or is larger than
    /// may be read.
    pub(crate) fn take(&self, stage: Stage, made_from: &MadeFrom, max_file_bytes: u64) -> Option<Taken> {
        let record = self.record(stage, made_from)?;
        let files = record.files().iter().map(|(file, digest)| {
            self.object_bytes(digest, max_file_bytes).map(|bytes| (file.clone(), bytes))
        });
        let files = files.collect::<Option<Vec<_>>>()?;
        clock::mark_as_used(&self.key_file(stage, &made_from.key()));
        Some(Taken { files, line: record.line })
    }

    /// Stores a stage's results.
    ///
    /// # Errors
    /// [`Error`] if a file cannot be written.
    pub(crate) fn keep(
        &self,
        stage: Stage,
        record: &Record,
        files: &[(String, Vec<u8>)],
    ) -> Result<(), Error> {
        let _lock = self.lock(|file| file.lock_shared().map_err(TryLockError::Error))?;
        let tag = self.root().join("CACHEDIR.TAG");
        if !tag.exists() {
            write_file(&tag, TAG.as_bytes())?;
        }
        for (file, bytes) in files {
            let Some(digest) = record.files().get(file) else { continue };
            let object = self.object(digest);
            let is_there = file_digest(&object).is_ok_and(|(_, found)| found == *digest);
            if !is_there {
                write_file(&object, bytes)?;
            }
        }
        let json = record.to_json();
        let text = format!("{}\n{json}", hex_digest(json.as_bytes()));
        write_file(&self.key_file(stage, record.key()), text.as_bytes())
    }

    /// Removes what was used least lately until the store is within its limit; nothing while another run stores.
    pub(crate) fn make_room(&self) {
        let Ok(Some(_lock)) = self.lock(File::try_lock) else { return };
        let sizes: BTreeMap<String, u64> = files_in(&self.root().join("objects")).collect();
        let mut keys = self.keys();
        keys.sort_by(|a, b| b.used.cmp(&a.used).then_with(|| a.path.cmp(&b.path)));
        let (mut kept, mut total) = (BTreeSet::new(), 0_u64);
        for key in keys {
            let new: BTreeSet<&String> =
                key.digests.iter().filter(|digest| !kept.contains(*digest)).collect();
            let added: u64 = new.iter().filter_map(|digest| sizes.get(*digest)).sum();
            if total.saturating_add(added) > self.max_bytes || key.digests.is_empty() {
                let _ = fs::remove_file(&key.path);
            } else {
                total += added;
                kept.extend(key.digests);
            }
        }
        // What no record names, and what a run that was killed has left.
        for name in sizes.keys().filter(|name| !kept.contains(*name)) {
            let _ = fs::remove_file(self.object(name));
        }
    }

    /// The record of a stage's results, if it is as it was stored and speaks of just what is asked for.
    fn record(&self, stage: Stage, made_from: &MadeFrom) -> Option<Record> {
        let bytes = bytes_of(&self.key_file(stage, &made_from.key()), MAX_RECORD_BYTES)?;
        let record = parse_record(stage, &bytes)?;
        (record.made_from() == made_from).then_some(record)
    }

    /// The bytes of a digest. Altered ones are removed, so that they are stored anew.
    fn object_bytes(&self, digest: &str, max_bytes: u64) -> Option<Vec<u8>> {
        let path = self.object(digest);
        let bytes = bytes_of(&path, max_bytes)?;
        let is_whole = hex_digest(&bytes) == digest;
        if !is_whole {
            let _ = fs::remove_file(path);
        }
        is_whole.then_some(bytes)
    }

    fn root(&self) -> PathBuf {
        self.folder.join(FOLDER)
    }

    fn key_file(&self, stage: Stage, key: &str) -> PathBuf {
        self.root().join("keys").join(format!("{stage}-{key}"))
    }

    /// Where the bytes of a digest are. A name that is no digest, of a file left half-written, is in a folder likewise.
    fn object(&self, digest: &str) -> PathBuf {
        let folder: String = digest.trim_start_matches('.').chars().take(2).collect();
        self.root().join("objects").join(folder).join(digest)
    }

    /// The lock of the store, as far as the file system has locks; none where it cannot be had now.
    fn lock(&self, take: impl Fn(&File) -> Result<(), TryLockError>) -> Result<Option<File>, Error> {
        let root = self.root();
        let create = |source| Error::Create { path: root.clone(), source };
        fs::create_dir_all(&root).map_err(create)?;
        let file = File::create(root.join(".lock")).map_err(create)?;
        match take(&file) {
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(source)) if source.kind() != ErrorKind::Unsupported => {
                Err(create(source))
            }
            _ => Ok(Some(file)),
        }
    }

    /// All records, with the time of their last use. One that cannot be read names no file.
    fn keys(&self) -> Vec<Key> {
        let Ok(entries) = fs::read_dir(self.root().join("keys")) else { return Vec::new() };
        let key = |entry: fs::DirEntry| {
            let (path, name) = (entry.path(), entry.file_name());
            let used = entry.metadata().ok()?.modified().ok()?;
            let stage = name.to_str().and_then(|name| Stage::from_name(name.split('-').next()?));
            let record = stage.and_then(|stage| parse_record(stage, &bytes_of(&path, MAX_RECORD_BYTES)?));
            let digests = record.map_or_else(Vec::new, |record| record.files().values().cloned().collect());
            Some(Key { path, used, digests })
        };
        entries.filter_map(|entry| key(entry.ok()?)).collect()
    }
}

/// A record of the store.
struct Key {
    path: PathBuf,
    used: SystemTime,
    /// The digests of its files.
    digests: Vec<String>,
}

/// A record behind its own digest.
fn parse_record(stage: Stage, bytes: &[u8]) -> Option<Record> {
    let end = bytes.iter().position(|byte| *byte == b'\n')?;
    let (digest, json) = (&bytes[..end], &bytes[end + 1..]);
    (hex_digest(json).as_bytes() == digest).then(|| Record::parsed(stage, json))?
}

/// The bytes of a file that is not too large; none if it is no such file.
fn bytes_of(path: &Path, max_bytes: u64) -> Option<Vec<u8>> {
    let metadata = fs::metadata(path).ok()?;
    if !metadata.is_file() || metadata.len() > max_bytes {
        return None;
    }
    fs::read(path).ok()
}

/// The names and sizes of the files in the folders of a folder.
fn files_in(folder: &Path) -> impl Iterator<Item = (String, u64)> {
    let entries = |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten();
    entries(folder).flat_map(move |inner| entries(&inner.path())).filter_map(|entry| {
        let name = entry.file_name().into_string().ok()?;
        Some((name, entry.metadata().ok()?.len()))
    })
}

#[cfg(test)]
#[allow(clippy::expect_used, reason = "a test says what it expects")]
mod tests {
    use super::*;

    fn cache(folder: &Path, max_bytes: u64) -> Cache {
        Cache { folder: folder.to_owned(), max_bytes }
    }

    /// Stores a stage's results made from a seed: one file of so many bytes.
    fn store(cache: &Cache, seed: u32, n_bytes: usize) -> MadeFrom {
        let made_from = MadeFrom(BTreeMap::from([("seed".to_owned(), seed.to_string())]));
        let bytes = vec![seed as u8; n_bytes];
        let files = vec![("views.json".to_owned(), bytes.clone())];
        let digests = BTreeMap::from([("views.json".to_owned(), hex_digest(&bytes))]);
        let record = Record::new(Stage::Views, made_from.clone(), digests, "a line".to_owned());
        cache.keep(Stage::Views, &record, &files).expect("a store");
        made_from
    }

    fn has(cache: &Cache, made_from: &MadeFrom) -> bool {
        cache.take(Stage::Views, made_from, 1 << 20).is_some()
    }

    #[test]
    fn what_is_stored_is_taken_and_nothing_else() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let cache = cache(folder.path(), 1 << 20);
        let made_from = store(&cache, 7, 100);
        let taken = cache.take(Stage::Views, &made_from, 1 << 20).expect("results");
        assert_eq!(
            (taken.files, taken.line.as_str()),
            (vec![("views.json".to_owned(), vec![7; 100])], "a line")
        );
        assert!(cache.take(Stage::Embed, &made_from, 1 << 20).is_none(), "of another stage");
        assert!(cache.take(Stage::Views, &made_from, 99).is_none(), "larger than allowed");
        let other = MadeFrom(BTreeMap::from([("seed".to_owned(), "8".to_owned())]));
        assert!(!cache.has(Stage::Views, &other) && !has(&cache, &other));
    }

    /// Every byte of the store, flipped, cut, or taken from another file: a miss, and whole after the next store.
    #[test]
    fn damage_is_a_miss() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let cache = cache(folder.path(), 1 << 20);
        let made_from = store(&cache, 7, 40);
        store(&cache, 8, 40);
        let object = cache.object(&hex_digest(&[7; 40]));
        let (key, other) =
            (cache.key_file(Stage::Views, &made_from.key()), cache.object(&hex_digest(&[8; 40])));
        for path in [&object, &key] {
            let whole = fs::read(path).expect("a file");
            let flipped = (0..whole.len()).map(|place| {
                let mut bytes = whole.clone();
                bytes[place] ^= 1;
                bytes
            });
            let cut = (0..whole.len()).map(|end| whole[..end].to_vec());
            for damaged in flipped.chain(cut).chain([fs::read(&other).expect("a file")]) {
                fs::write(path, &damaged).expect("write");
                assert!(!has(&cache, &made_from), "{}", String::from_utf8_lossy(&damaged));
                store(&cache, 7, 40);
                assert!(has(&cache, &made_from), "not mended");
            }
        }
    }

    #[test]
    fn the_least_lately_used_go_first() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let cache = cache(folder.path(), 250);
        let stored: Vec<MadeFrom> = (0..4).map(|seed| store(&cache, seed, 100)).collect();
        for (age, made_from) in stored.iter().enumerate() {
            let file = File::options().write(true).open(cache.key_file(Stage::Views, &made_from.key()));
            let used = SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(1000 * age as u64);
            file.and_then(|file| file.set_modified(used)).expect("a time");
        }
        assert!(has(&cache, &stored[0]), "used again");
        let left = cache.root().join("objects/aa/.aa.half");
        write_file(&left, &[0; 10]).expect("write");
        let alone = File::open(cache.root().join(".lock")).expect("lock file");
        alone.lock_shared().expect("lock");
        cache.make_room();
        assert!(left.exists(), "another run is storing");
        drop(alone);
        cache.make_room();
        let there: Vec<bool> = stored.iter().map(|made_from| has(&cache, made_from)).collect();
        assert_eq!(there, [true, false, false, true]);
        assert_eq!(files_in(&cache.root().join("objects")).map(|(_, bytes)| bytes).sum::<u64>(), 200);
    }
}
