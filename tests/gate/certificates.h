// Certificates for tests, made with OpenSSL: an authority, and what it signs. All are in PEM format.
#pragma once

#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>

#include <memory>
#include <string>

namespace sightline::test {

struct SignedPair {
  std::string certificate, key;
};

class Authority {
 public:
  Authority() : key_(EVP_EC_gen("P-256"), &EVP_PKEY_free), certificate_(make(key_.get(), "authority", 3600)) {
    extend(certificate_.get(), NID_basic_constraints, "critical,CA:TRUE");
    X509_sign(certificate_.get(), key_.get(), EVP_sha256());
  }

  std::string certificate() const { return text_of(certificate_.get()); }
  // A certificate with this common name, which is valid for so long from now on. `alternative` is as in "URI:a,DNS:b";
  // empty: none.
  SignedPair sign(const std::string& name, const std::string& alternative = {}, long valid_s = 3600) const {
    const Key key(EVP_EC_gen("P-256"), &EVP_PKEY_free);
    const Certificate certificate = make(key.get(), name, valid_s);
    if (!alternative.empty()) extend(certificate.get(), NID_subject_alt_name, alternative);
    X509_sign(certificate.get(), key_.get(), EVP_sha256());
    const Bio bio(BIO_new(BIO_s_mem()), &BIO_free);
    PEM_write_bio_PrivateKey(bio.get(), key.get(), nullptr, nullptr, 0, nullptr, nullptr);
    return {text_of(certificate.get()), text_in(bio)};
  }

 private:
  using Bio = std::unique_ptr<BIO, decltype(&BIO_free)>;
  using Key = std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)>;
  using Certificate = std::unique_ptr<X509, decltype(&X509_free)>;

  static Certificate make(EVP_PKEY* key, const std::string& name, long valid_s) {
    static long serial = 0;
    Certificate made(X509_new(), &X509_free);
    X509_set_version(made.get(), 2);
    ASN1_INTEGER_set(X509_get_serialNumber(made.get()), ++serial);
    X509_gmtime_adj(X509_getm_notBefore(made.get()), -7200);
    X509_gmtime_adj(X509_getm_notAfter(made.get()), valid_s);
    X509_set_pubkey(made.get(), key);
    set_name(X509_get_subject_name(made.get()), name);
    set_name(X509_get_issuer_name(made.get()), "authority");
    return made;
  }
  static void set_name(X509_NAME* where, const std::string& name) {
    X509_NAME_add_entry_by_txt(where, "CN", MBSTRING_ASC, reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1,
                               0);
  }
  static void extend(X509* certificate, int kind, const std::string& value) {
    X509_EXTENSION* const extension = X509V3_EXT_conf_nid(nullptr, nullptr, kind, value.c_str());
    X509_add_ext(certificate, extension, -1);
    X509_EXTENSION_free(extension);
  }
  static std::string text_of(X509* certificate) {
    const Bio bio(BIO_new(BIO_s_mem()), &BIO_free);
    PEM_write_bio_X509(bio.get(), certificate);
    return text_in(bio);
  }
  static std::string text_in(const Bio& bio) {
    char* data = nullptr;
    const long size = BIO_get_mem_data(bio.get(), &data);
    return {data, static_cast<size_t>(size)};
  }

  const Key key_;
  const Certificate certificate_;
};

}  // namespace sightline::test
