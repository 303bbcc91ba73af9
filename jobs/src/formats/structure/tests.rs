//! On files of our own, whole, cut and turned.

use super::{Refusal, contents, read};
use crate::formats::hdf5_file::write;

fn sample() -> Vec<u8> {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("x.h5");
    let file = hdf5::File::create(&path).unwrap();
    let group = file.create_group("VTKHDF").unwrap();
    write(&group, "Points", 3, &[0.5; 30]).unwrap();
    write(&group, "Empty", 1, &[0_u64; 0]).unwrap();
    for k in 0..40 {
        file.create_group(&format!("g{k}")).unwrap();
    }
    drop(group);
    file.close().unwrap();
    std::fs::read(&path).unwrap()
}

#[test]
fn our_own_files_are_understood() {
    let structure = read(sample().as_slice()).unwrap_or_else(|refusal| panic!("{refusal}"));
    let points = &structure.data_sets["/VTKHDF/Points"];
    assert_eq!((points.extent.as_slice(), points.element_bytes, points.is_float), ([10, 3].as_slice(), 8, true));
    assert_eq!(structure.data_sets["/VTKHDF/Empty"].elements(), 0);
    assert_eq!(structure.groups.len(), 42);
}

#[test]
fn whatever_is_cut_or_turned_is_refused_or_understood_and_never_a_panic() {
    let bytes = sample();
    for length in 0..bytes.len() {
        assert!(read(&bytes[..length]).is_err(), "{length}");
    }
    for k in (0..bytes.len() * 8).step_by(11) {
        let mut broken = bytes.clone();
        broken[k / 8] ^= 1 << (k % 8);
        let _ = read(broken.as_slice());
    }
    assert_eq!(read(b"solid".as_slice()), Err(Refusal::NotHdf5));
}

#[test]
fn contents_are_what_libhdf5_wrote_in_one_piece_and_in_chunks() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("x.h5");
    let values: Vec<u64> = (0..3 * 200_000).map(|k| k * k).collect();
    let file = hdf5::File::create(&path).unwrap();
    write(&file, "chunks", 3, &values).unwrap();
    file.new_dataset::<u64>().shape(values.len()).create("piece").unwrap().write_raw(&values).unwrap();
    file.new_dataset::<u64>().chunk(100).shape(1000).create("holes").unwrap();
    file.close().unwrap();
    let file = std::fs::File::open(&path).unwrap();
    let structure = read(&file).unwrap();
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    assert!(contents(&file, "/chunks", &structure.data_sets["/chunks"]).unwrap() == bytes);
    assert!(contents(&file, "/piece", &structure.data_sets["/piece"]).unwrap() == bytes);
    assert!(contents(&file, "/holes", &structure.data_sets["/holes"]).is_err());
}
