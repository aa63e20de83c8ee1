//! Whole files into memory, within limits.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::IoError;

/// Largest file that is read, bytes.
pub(crate) const MAX_FILE_BYTES: u64 = 4 << 30;

/// Reads a file of at most [`MAX_FILE_BYTES`].
pub(crate) fn read_bytes(path: &Path) -> Result<Vec<u8>, IoError> {
    let file = File::open(path).map_err(|e| IoError::read(path, e))?;
    let bytes = file.metadata().map_err(|e| IoError::read(path, e))?.len();
    check_size(path, bytes)?;
    let mut content = Vec::with_capacity(usize::try_from(bytes).unwrap_or(0));
    // A file may grow, and a pipe has no size: the limit holds for what is actually read.
    file.take(MAX_FILE_BYTES + 1)
        .read_to_end(&mut content)
        .map_err(|e| IoError::read(path, e))?;
    check_size(path, content.len() as u64)?;
    Ok(content)
}

fn check_size(path: &Path, bytes: u64) -> Result<(), IoError> {
    if bytes > MAX_FILE_BYTES {
        return Err(IoError::FileTooLarge {
            path: path.to_owned(),
            bytes,
            limit: MAX_FILE_BYTES,
        });
    }
    Ok(())
}

/// Returns the bytes after a UTF-8 byte order mark, if there is one; refuses UTF-16 and UTF-32.
pub(crate) fn text_bytes<'a>(path: &Path, content: &'a [u8]) -> Result<&'a [u8], IoError> {
    let found = match content {
        [0xef, 0xbb, 0xbf, rest @ ..] => return Ok(rest),
        [0, 0, 0xfe, 0xff, ..] => "UTF-32 BE",
        [0xff, 0xfe, 0, 0, ..] => "UTF-32 LE",
        [0xfe, 0xff, ..] => "UTF-16 BE",
        [0xff, 0xfe, ..] => "UTF-16 LE",
        _ => return Ok(content),
    };
    Err(IoError::Encoding {
        path: path.to_owned(),
        found,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sparse_file_above_the_limit_is_refused_unread() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("huge.obj");
        let file = File::create(&path).unwrap();
        file.set_len(MAX_FILE_BYTES + 1).unwrap();
        assert!(matches!(
            read_bytes(&path),
            Err(IoError::FileTooLarge { bytes, .. }) if bytes == MAX_FILE_BYTES + 1
        ));
    }

    #[test]
    fn byte_order_marks() {
        let path = Path::new("x");
        assert_eq!(text_bytes(path, b"\xef\xbb\xbfv").unwrap(), b"v");
        assert_eq!(text_bytes(path, b"v").unwrap(), b"v");
        for (bytes, name) in [
            (&b"\xfe\xff\0v"[..], "UTF-16 BE"),
            (&b"\xff\xfev\0"[..], "UTF-16 LE"),
            (&b"\xff\xfe\0\0"[..], "UTF-32 LE"),
        ] {
            assert!(matches!(
                text_bytes(path, bytes),
                Err(IoError::Encoding { found, .. }) if found == name
            ));
        }
    }
}
