// Checks the manifests of deploy/ with the types and rules of those who read them: kustomize builds them, the API machinery of Kubernetes decodes
// them strictly, the evaluator of Pod Security judges the pods, and the loader of Compose reads the compose file. Numbers are compared with the daemon's own
// defaults. SIGHTLINED is the path of the daemon. Agones publishes its types nowhere that a module proxy offers, so the fields of a
// Fleet that we use are declared here, after its custom resource definition.
package manifests

import (
	"bytes"
	"context"
	"maps"
	"os"
	"os/exec"
	"path/filepath"
	"regexp"
	"slices"
	"strconv"
	"strings"
	"testing"
	"time"

	"github.com/compose-spec/compose-go/v2/cli"
	appsv1 "k8s.io/api/apps/v1"
	corev1 "k8s.io/api/core/v1"
	networkingv1 "k8s.io/api/networking/v1"
	metav1 "k8s.io/apimachinery/pkg/apis/meta/v1"
	"k8s.io/apimachinery/pkg/labels"
	"k8s.io/apimachinery/pkg/runtime"
	"k8s.io/apimachinery/pkg/runtime/schema"
	"k8s.io/apimachinery/pkg/runtime/serializer"
	clientscheme "k8s.io/client-go/kubernetes/scheme"
	"k8s.io/pod-security-admission/api"
	"k8s.io/pod-security-admission/policy"
	"sigs.k8s.io/kustomize/api/krusty"
	"sigs.k8s.io/kustomize/kyaml/filesys"
)

const deploy = "../../../deploy"

var folders = []string{"base", "sidecar", "fleet", "pool"}

// Time that a daemon needs after --drain-s to end its calls and to complete recordings.
const afterDrain = 5 * time.Second

type FleetPort struct {
	Name          string `json:"name"`
	PortPolicy    string `json:"portPolicy"`
	Container     string `json:"container"`
	ContainerPort int32  `json:"containerPort"`
	Protocol      string `json:"protocol"`
}

type Fleet struct {
	metav1.TypeMeta   `json:",inline"`
	metav1.ObjectMeta `json:"metadata"`
	Spec              struct {
		Replicas int32 `json:"replicas"`
		Template struct {
			Spec struct {
				Container string                 `json:"container"`
				Ports     []FleetPort            `json:"ports"`
				Template  corev1.PodTemplateSpec `json:"template"`
			} `json:"spec"`
		} `json:"template"`
	} `json:"spec"`
}

func (f *Fleet) DeepCopyObject() runtime.Object { c := *f; return &c }

func decoder(t *testing.T) runtime.Decoder {
	scheme := runtime.NewScheme()
	if err := clientscheme.AddToScheme(scheme); err != nil {
		t.Fatal(err)
	}
	scheme.AddKnownTypeWithName(schema.GroupVersionKind{Group: "agones.dev", Version: "v1", Kind: "Fleet"}, &Fleet{})
	return serializer.NewCodecFactory(scheme, serializer.EnableStrict).UniversalDeserializer()
}

func built(t *testing.T, folder string) []runtime.Object {
	resources, err := krusty.MakeKustomizer(krusty.MakeDefaultOptions()).Run(filesys.MakeFsOnDisk(), filepath.Join(deploy, "kubernetes", folder))
	if err != nil {
		t.Fatalf("%s: %v", folder, err)
	}
	var objects []runtime.Object
	for _, resource := range resources.Resources() {
		text, err := resource.AsYAML()
		if err != nil {
			t.Fatal(err)
		}
		object, _, err := decoder(t).Decode(text, nil, nil)
		if err != nil {
			t.Errorf("%s: %s: %v", folder, resource.CurId(), err)
			continue
		}
		objects = append(objects, object)
	}
	return objects
}

type pod struct {
	folder   string
	meta     metav1.ObjectMeta
	spec     corev1.PodSpec
	selector *metav1.LabelSelector
}

func pods(t *testing.T) []pod {
	var all []pod
	for _, folder := range folders {
		for _, object := range built(t, folder) {
			switch o := object.(type) {
			case *appsv1.Deployment:
				all = append(all, pod{folder, o.Spec.Template.ObjectMeta, o.Spec.Template.Spec, o.Spec.Selector})
			case *Fleet:
				all = append(all, pod{folder, o.Spec.Template.Spec.Template.ObjectMeta, o.Spec.Template.Spec.Template.Spec, nil})
			}
		}
	}
	if len(all) != 3 {
		t.Fatalf("there are %d kinds of pods", len(all))
	}
	return all
}

func daemon(t *testing.T, p pod) corev1.Container {
	for _, container := range append(slices.Clone(p.spec.InitContainers), p.spec.Containers...) {
		if container.Name == "sightline" {
			return container
		}
	}
	t.Fatalf("%s: no daemon", p.folder)
	return corev1.Container{}
}

// The value of a flag of the daemon, in seconds: in `arguments`, or its default.
func seconds(t *testing.T, flag string, arguments []string) time.Duration {
	if at := slices.Index(arguments, "--"+flag); at >= 0 {
		value, err := strconv.ParseFloat(arguments[at+1], 64)
		if err != nil {
			t.Fatal(err)
		}
		return time.Duration(value * float64(time.Second))
	}
	defaults, err := exec.Command(os.Getenv("SIGHTLINED"), "--print-config").Output()
	if err != nil {
		t.Fatal(err)
	}
	found := regexp.MustCompile(`(?m)^` + flag + `\s*=\s*"?([0-9.]+)`).FindSubmatch(defaults)
	if found == nil {
		t.Fatalf("the daemon has no flag --%s", flag)
	}
	value, _ := strconv.ParseFloat(string(found[1]), 64)
	return time.Duration(value * float64(time.Second))
}

// Flags that name folders of the image are left out: they do not exist here.
func checkArguments(t *testing.T, where string, arguments []string) {
	if at := slices.Index(arguments, "--scene-dir"); at >= 0 {
		arguments = slices.Delete(slices.Clone(arguments), at, at+2)
	}
	output, err := exec.Command(os.Getenv("SIGHTLINED"), append(slices.Clone(arguments), "--check-config")...).CombinedOutput()
	if err != nil {
		t.Errorf("%s: %v: %s", where, arguments, output)
	}
}

func TestEveryFolderBuildsAndDecodesStrictly(t *testing.T) {
	kinds := map[string]int{}
	for _, folder := range folders {
		for _, object := range built(t, folder) {
			kinds[object.GetObjectKind().GroupVersionKind().Kind]++
		}
	}
	for _, kind := range []string{"Namespace", "Deployment", "Fleet", "Service", "HorizontalPodAutoscaler", "PodDisruptionBudget", "NetworkPolicy"} {
		if kinds[kind] == 0 {
			t.Errorf("there is no %s", kind)
		}
	}
}

func TestAFieldThatDoesNotExistIsNoticed(t *testing.T) {
	for _, file := range []string{"sidecar/game-server.yaml", "fleet/fleet.yaml"} {
		text, err := os.ReadFile(filepath.Join(deploy, "kubernetes", file))
		if err != nil {
			t.Fatal(err)
		}
		for _, field := range []string{"restartPolicy: Always", "terminationGracePeriodSeconds", "replicas", "sizeLimit"} {
			if !bytes.Contains(text, []byte(field)) {
				t.Fatalf("%s has no %s", file, field)
			}
			if _, _, err := decoder(t).Decode(bytes.Replace(text, []byte(field), []byte("x"+field), 1), nil, nil); err == nil {
				t.Errorf("%s: x%s was accepted", file, field)
			}
		}
	}
}

func TestPodsKeepToPodSecurityRestricted(t *testing.T) {
	evaluator, err := policy.NewEvaluator(policy.DefaultChecks())
	if err != nil {
		t.Fatal(err)
	}
	level := api.LevelVersion{Level: api.LevelRestricted, Version: api.LatestVersion()}
	for _, p := range pods(t) {
		judge := func() policy.AggregateCheckResult {
			return policy.AggregateCheckResults(evaluator.EvaluatePod(level, &p.meta, &p.spec))
		}
		if result := judge(); !result.Allowed {
			t.Errorf("%s: %s", p.folder, result.ForbiddenDetail())
		}
		p.spec.SecurityContext.RunAsNonRoot = nil
		if judge().Allowed {
			t.Errorf("%s: a pod that may run as root was allowed", p.folder)
		}
	}
}

func TestDaemonsRunAsTheImageExpects(t *testing.T) {
	for _, p := range pods(t) {
		container := daemon(t, p)
		checkArguments(t, p.folder, container.Args)
		if user := *p.spec.SecurityContext.RunAsUser; user != 65532 {
			t.Errorf("%s: user %d", p.folder, user)
		}
		if !*container.SecurityContext.ReadOnlyRootFilesystem {
			t.Errorf("%s: the root can be written", p.folder)
		}
		if p.meta.Labels["sightline.dev/daemon"] != "true" {
			t.Errorf("%s: the network policy of the metrics does not select the pod", p.folder)
		}
		if p.selector != nil {
			for key, value := range p.selector.MatchLabels {
				if p.meta.Labels[key] != value {
					t.Errorf("%s: the selector does not match", p.folder)
				}
			}
		}
	}
}

func TestGraceIsLongerThanTheDrain(t *testing.T) {
	for _, p := range pods(t) {
		drain := seconds(t, "drain-s", daemon(t, p).Args)
		if grace := time.Duration(*p.spec.TerminationGracePeriodSeconds) * time.Second; grace < drain+afterDrain {
			t.Errorf("%s: the daemon drains for %v and is killed after %v", p.folder, drain, grace)
		}
	}
}

func TestProbesAskWhatTheDaemonAnswers(t *testing.T) {
	for _, p := range pods(t) {
		container := daemon(t, p)
		metrics := container.Args[slices.Index(container.Args, "--metrics-listen")+1]
		named := map[string]int32{}
		for _, port := range container.Ports {
			named[port.Name] = port.ContainerPort
		}
		if !strings.HasSuffix(metrics, ":"+strconv.Itoa(int(named["metrics"]))) {
			t.Errorf("%s: port %d, but the daemon listens at %s", p.folder, named["metrics"], metrics)
		}
		if p.meta.Annotations["prometheus.io/port"] != strconv.Itoa(int(named["metrics"])) {
			t.Errorf("%s: Prometheus asks another port", p.folder)
		}
		if got := container.LivenessProbe.HTTPGet; got.Path != "/livez" || got.Port.StrVal != "metrics" {
			t.Errorf("%s: liveness asks %v", p.folder, got)
		}
		if got := container.ReadinessProbe.HTTPGet; got.Path != "/readyz" || got.Port.StrVal != "metrics" {
			t.Errorf("%s: readiness asks %v", p.folder, got)
		}
		if probe := container.StartupProbe.Exec; probe != nil {
			checkProbe(t, p.folder, probe.Command, container.Args)
		}
	}
}

// The command of an exec probe asks at the socket at which the daemon listens.
func checkProbe(t *testing.T, where string, command, arguments []string) {
	if command[0] != "sightlined" || command[1] != "healthcheck" {
		t.Errorf("%s: %v", where, command)
	}
	socket := arguments[slices.Index(arguments, "--listen-unix")+1]
	if command[slices.Index(command, "--listen-unix")+1] != socket {
		t.Errorf("%s: the probe does not ask at %s", where, socket)
	}
}

func TestSidecarsShareTheirSocketWithTheGame(t *testing.T) {
	for _, p := range pods(t) {
		if len(p.spec.InitContainers) == 0 {
			continue
		}
		sidecar, game := daemon(t, p), p.spec.Containers[0]
		if sidecar.RestartPolicy == nil || *sidecar.RestartPolicy != corev1.ContainerRestartPolicyAlways {
			t.Errorf("%s: the daemon is no native sidecar", p.folder)
		}
		socket := sidecar.Args[slices.Index(sidecar.Args, "--listen-unix")+1]
		for _, container := range []corev1.Container{sidecar, game} {
			if len(container.VolumeMounts) != 1 || filepath.Dir(socket) != container.VolumeMounts[0].MountPath {
				t.Errorf("%s: %s does not have the folder of the socket", p.folder, container.Name)
			}
		}
		if game.Env[0].Value != "unix:"+socket {
			t.Errorf("%s: the game connects to %s", p.folder, game.Env[0].Value)
		}
		if *p.spec.SecurityContext.FSGroup != 65532 {
			t.Errorf("%s: the containers have no group in common", p.folder)
		}
	}
}

func TestTheFleetNamesTheContainerOfTheGame(t *testing.T) {
	for _, object := range built(t, "fleet") {
		fleet, ok := object.(*Fleet)
		if !ok {
			continue
		}
		spec := fleet.Spec.Template.Spec
		if spec.Container != spec.Template.Spec.Containers[0].Name || spec.Ports[0].Container != spec.Container {
			t.Errorf("the container is %q", spec.Container)
		}
	}
}

// The ports of a pod that a network policy of its folder, or of the folder base, lets something reach.
func reachable(t *testing.T, p pod) map[int32]bool {
	ports := map[int32]bool{}
	for _, object := range built(t, p.folder) {
		policy, ok := object.(*networkingv1.NetworkPolicy)
		if !ok {
			continue
		}
		selector, err := metav1.LabelSelectorAsSelector(&policy.Spec.PodSelector)
		if err != nil {
			t.Fatal(err)
		}
		if !selector.Matches(labels.Set(p.meta.Labels)) {
			continue
		}
		for _, rule := range policy.Spec.Ingress {
			for _, port := range rule.Ports {
				ports[port.Port.IntVal] = true
			}
		}
	}
	return ports
}

// A pod without a policy is open to the whole cluster; one with a policy is closed but for its rules.
func TestNetworkPoliciesLetInWhatEachPodOffers(t *testing.T) {
	offered := map[string][]int32{"sidecar": {7654, 50152}, "fleet": {7654, 50152}, "pool": {50151, 50152}}
	for _, p := range pods(t) {
		got := slices.Sorted(maps.Keys(reachable(t, p)))
		if !slices.Equal(got, offered[p.folder]) {
			t.Errorf("%s: the policies let in %v", p.folder, got)
		}
	}
}

func TestComposeFile(t *testing.T) {
	options, err := cli.NewProjectOptions([]string{filepath.Join(deploy, "compose/compose.yaml")}, cli.WithOsEnv)
	if err != nil {
		t.Fatal(err)
	}
	project, err := options.LoadProject(context.Background())
	if err != nil {
		t.Fatal(err)
	}
	service := project.Services["sightline"]
	arguments := imageArguments(t)
	if grace := time.Duration(*service.StopGracePeriod); grace < seconds(t, "drain-s", arguments)+afterDrain {
		t.Errorf("the daemon is killed after %v", grace)
	}
	checkProbe(t, "compose", service.HealthCheck.Test[1:], arguments)
	for _, name := range []string{"sightline", "game"} {
		one := project.Services[name]
		if one.User != "65532:65532" || !one.ReadOnly || !slices.Equal(one.CapDrop, []string{"ALL"}) {
			t.Errorf("%s is not confined", name)
		}
	}
	for name, one := range project.Services {
		for _, volume := range one.Volumes {
			if volume.Type != "bind" {
				continue
			}
			if _, err := os.Stat(volume.Source); err != nil {
				t.Errorf("%s: %v", name, err)
			}
		}
	}
}

// The arguments with which both images start the daemon.
func imageArguments(t *testing.T) []string {
	text, err := os.ReadFile(filepath.Join(deploy, "../Dockerfile"))
	if err != nil {
		t.Fatal(err)
	}
	var all [][]string
	for _, line := range regexp.MustCompile(`(?m)^CMD \[(.*)\]$`).FindAllStringSubmatch(string(text), -1) {
		var words []string
		for _, word := range regexp.MustCompile(`"([^"]*)"`).FindAllStringSubmatch(line[1], -1) {
			words = append(words, word[1])
		}
		all = append(all, words)
	}
	if len(all) != 2 || !slices.Equal(all[0], all[1]) {
		t.Fatalf("the images start the daemon differently: %v", all)
	}
	return all[0]
}

func TestTheImagesStartTheDaemonWithFlagsThatItHas(t *testing.T) {
	checkArguments(t, "Dockerfile", imageArguments(t))
}
